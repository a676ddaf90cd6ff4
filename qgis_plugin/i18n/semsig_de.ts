<?xml version="1.0" encoding="utf-8"?>
<!DOCTYPE TS>
<TS version="2.1" language="de" sourcelanguage="en">
<context>
    <name>Semsig</name>
    <message>
        <source>1. Load street objects</source>
        <translation>1. Straßenobjekte laden</translation>
    </message>
    <message>
        <source>2. Build signature database</source>
        <translation>2. Signaturdatenbank aufbauen</translation>
    </message>
    <message>
        <source>3. Localize a query</source>
        <translation>3. Anfrage verorten</translation>
    </message>
    <message>
        <source>4. Evaluate</source>
        <translation>4. Auswerten</translation>
    </message>
    <message>
        <source>5. Where queries can be placed</source>
        <translation>5. Wo Anfragen verortet werden können</translation>
    </message>
    <message>
        <source>6. Export cells</source>
        <translation>6. Zellen exportieren</translation>
    </message>
    <message>
        <source>A cell is drawn as</source>
        <translation>Eine Zelle wird gezeichnet als</translation>
    </message>
    <message>
        <source>A cell must see</source>
        <translation>Eine Zelle muss sehen</translation>
    </message>
    <message>
        <source>Ambiguity</source>
        <translation>Mehrdeutigkeit</translation>
    </message>
    <message>
        <source>Angle levels</source>
        <translation>Winkelstufen</translation>
    </message>
    <message>
        <source>Answer</source>
        <translation>Antwort</translation>
    </message>
    <message>
        <source>Area</source>
        <translation>Gebiet</translation>
    </message>
    <message>
        <source>Around the regions (m)</source>
        <translation>Um die Gebiete herum (m)</translation>
    </message>
    <message>
        <source>Bearings (°)</source>
        <translation>Richtungen (°)</translation>
    </message>
    <message>
        <source>Best candidates that count</source>
        <translation>Beste Kandidaten, die zählen</translation>
    </message>
    <message>
        <source>Buildings</source>
        <translation>Gebäude</translation>
    </message>
    <message>
        <source>CRS of the files</source>
        <translation>KBS der Dateien</translation>
    </message>
    <message>
        <source>CRS to work in</source>
        <translation>KBS zum Arbeiten</translation>
    </message>
    <message>
        <source>Cancel</source>
        <translation>Abbrechen</translation>
    </message>
    <message>
        <source>Cancelled; what was there before is as it was.</source>
        <translation>Abgebrochen; was vorher da war, ist unverändert.</translation>
    </message>
    <message>
        <source>Candidates</source>
        <translation>Kandidaten</translation>
    </message>
    <message>
        <source>Cannot tell: within {metres} m of the best place with a chance of {chance}.</source>
        <translation>Nicht zu sagen: mit einer Wahrscheinlichkeit von {chance} im Umkreis von {metres} m um den besten Ort.</translation>
    </message>
    <message>
        <source>Catalogue</source>
        <translation>Katalog</translation>
    </message>
    <message>
        <source>Catalogue of your own</source>
        <translation>Eigener Katalog</translation>
    </message>
    <message>
        <source>Catalogues</source>
        <translation>Kataloge</translation>
    </message>
    <message>
        <source>Cell {cell} sees {types}; {alike} other cells see the same types.</source>
        <translation>Zelle {cell} sieht {types}; {alike} andere Zellen sehen dieselben Arten.</translation>
    </message>
    <message>
        <source>Cells</source>
        <translation>Zellen</translation>
    </message>
    <message>
        <source>Chance</source>
        <translation>Wahrscheinlichkeit</translation>
    </message>
    <message>
        <source>Chance that the regions hold</source>
        <translation>Wahrscheinlichkeit in den Gebieten</translation>
    </message>
    <message>
        <source>Choose a rank in the list to go there.</source>
        <translation>Wählen Sie einen Rang in der Liste, um dorthin zu gehen.</translation>
    </message>
    <message>
        <source>Choose a signature database, and open it.</source>
        <translation>Wählen Sie eine Signaturdatenbank und öffnen Sie sie.</translation>
    </message>
    <message>
        <source>Choose what you see, and click its direction in the wheel. A click takes it away.</source>
        <translation>Wählen Sie, was Sie sehen, und klicken Sie seine Richtung im Rad an. Ein Klick darauf entfernt es.</translation>
    </message>
    <message>
        <source>Clear</source>
        <translation>Leeren</translation>
    </message>
    <message>
        <source>Click a cell</source>
        <translation>Zelle anklicken</translation>
    </message>
    <message>
        <source>Close</source>
        <translation>Schließen</translation>
    </message>
    <message>
        <source>Composes the view that is seen from a place of the map.</source>
        <translation>Stellt zusammen, was man von einer Stelle der Karte aus sieht.</translation>
    </message>
    <message>
        <source>Demo city</source>
        <translation>Beispielstadt</translation>
    </message>
    <message>
        <source>Detector</source>
        <translation>Detektor</translation>
    </message>
    <message>
        <source>Distortion</source>
        <translation>Verfälschung</translation>
    </message>
    <message>
        <source>Download OpenStreetMap for this canvas</source>
        <translation>OpenStreetMap für diesen Kartenausschnitt laden</translation>
    </message>
    <message>
        <source>Engine of Semantic signatures</source>
        <translation>Engine von Semantische Signaturen</translation>
    </message>
    <message>
        <source>Engine...</source>
        <translation>Engine ...</translation>
    </message>
    <message>
        <source>Explore a city</source>
        <translation>Stadt erkunden</translation>
    </message>
    <message>
        <source>Extent</source>
        <translation>Ausdehnung</translation>
    </message>
    <message>
        <source>Fetch a city</source>
        <translation>Stadt herunterladen</translation>
    </message>
    <message>
        <source>File</source>
        <translation>Datei</translation>
    </message>
    <message>
        <source>Files</source>
        <translation>Dateien</translation>
    </message>
    <message>
        <source>Find the place</source>
        <translation>Ort suchen</translation>
    </message>
    <message>
        <source>Folder</source>
        <translation>Ordner</translation>
    </message>
    <message>
        <source>Folder for the results</source>
        <translation>Ordner für die Ergebnisse</translation>
    </message>
    <message>
        <source>Folder of wheels</source>
        <translation>Ordner mit Wheels</translation>
    </message>
    <message>
        <source>Folder of wheels (leave empty to download them)</source>
        <translation>Ordner mit Wheels (leer lassen, um sie herunterzuladen)</translation>
    </message>
    <message>
        <source>Found within (m)</source>
        <translation>Gefunden im Umkreis von (m)</translation>
    </message>
    <message>
        <source>Found: the place is within {metres} m with a chance of {chance}.</source>
        <translation>Gefunden: Der Ort liegt mit einer Wahrscheinlichkeit von {chance} im Umkreis von {metres} m.</translation>
    </message>
    <message>
        <source>From the true to the best place</source>
        <translation>Vom wahren zum besten Ort</translation>
    </message>
    <message>
        <source>Further distortions</source>
        <translation>Weitere Verfälschungen</translation>
    </message>
    <message>
        <source>Help</source>
        <translation>Hilfe</translation>
    </message>
    <message>
        <source>Install</source>
        <translation>Installieren</translation>
    </message>
    <message>
        <source>Install again</source>
        <translation>Neu installieren</translation>
    </message>
    <message>
        <source>Installing the engine of Semantic signatures</source>
        <translation>Die Engine von Semantische Signaturen wird installiert</translation>
    </message>
    <message>
        <source>Looking for Python...</source>
        <translation>Python wird gesucht ...</translation>
    </message>
    <message>
        <source>Map page</source>
        <translation>Kartenseite</translation>
    </message>
    <message>
        <source>Method</source>
        <translation>Methode</translation>
    </message>
    <message>
        <source>North</source>
        <translation>Norden</translation>
    </message>
    <message>
        <source>North is off by (°)</source>
        <translation>Norden weicht ab um (°)</translation>
    </message>
    <message>
        <source>North is unknown</source>
        <translation>Norden unbekannt</translation>
    </message>
    <message>
        <source>Number of candidates</source>
        <translation>Anzahl der Kandidaten</translation>
    </message>
    <message>
        <source>Number of queries</source>
        <translation>Anzahl der Anfragen</translation>
    </message>
    <message>
        <source>Open</source>
        <translation>Öffnen</translation>
    </message>
    <message>
        <source>Open a database first.</source>
        <translation>Öffnen Sie zuerst eine Datenbank.</translation>
    </message>
    <message>
        <source>Opening; a large city takes some seconds...</source>
        <translation>Wird geöffnet; eine große Stadt dauert einige Sekunden ...</translation>
    </message>
    <message>
        <source>Overpass server (leave empty for the usual ones)</source>
        <translation>Overpass-Server (leer lassen für die üblichen)</translation>
    </message>
    <message>
        <source>Place</source>
        <translation>Ort</translation>
    </message>
    <message>
        <source>Python (3.11 or newer)</source>
        <translation>Python (3.11 oder neuer)</translation>
    </message>
    <message>
        <source>Python for the engine (leave empty to look for it)</source>
        <translation>Python für die Engine (leer lassen, um es zu suchen)</translation>
    </message>
    <message>
        <source>Queries</source>
        <translation>Anfragen</translation>
    </message>
    <message>
        <source>Rank</source>
        <translation>Rang</translation>
    </message>
    <message>
        <source>Regions to search</source>
        <translation>Zu durchsuchende Gebiete</translation>
    </message>
    <message>
        <source>Remove</source>
        <translation>Entfernen</translation>
    </message>
    <message>
        <source>Seed</source>
        <translation>Startwert</translation>
    </message>
    <message>
        <source>Seen from here</source>
        <translation>Von hier gesehen</translation>
    </message>
    <message>
        <source>Sees</source>
        <translation>Sieht</translation>
    </message>
    <message>
        <source>Semantic signatures</source>
        <translation>Semantische Signaturen</translation>
    </message>
    <message>
        <source>Shows what is seen from a cell, and the cells most like it.</source>
        <translation>Zeigt, was man aus einer Zelle sieht, und die Zellen, die ihr am meisten gleichen.</translation>
    </message>
    <message>
        <source>Side of a cell (m)</source>
        <translation>Seite einer Zelle (m)</translation>
    </message>
    <message>
        <source>Signature database</source>
        <translation>Signaturdatenbank</translation>
    </message>
    <message>
        <source>Signature databases (*.parquet)</source>
        <translation>Signaturdatenbanken (*.parquet)</translation>
    </message>
    <message>
        <source>Stopping...</source>
        <translation>Wird angehalten ...</translation>
    </message>
    <message>
        <source>Street objects</source>
        <translation>Straßenobjekte</translation>
    </message>
    <message>
        <source>Streets</source>
        <translation>Straßen</translation>
    </message>
    <message>
        <source>Suggest a catalogue</source>
        <translation>Katalog vorschlagen</translation>
    </message>
    <message>
        <source>The cells that a view from here would be taken for, by chance:</source>
        <translation>Die Zellen, für die ein Blick von hier gehalten würde, nach Wahrscheinlichkeit:</translation>
    </message>
    <message>
        <source>The engine did not answer.</source>
        <translation>Die Engine hat nicht geantwortet.</translation>
    </message>
    <message>
        <source>The engine ended.</source>
        <translation>Die Engine wurde beendet.</translation>
    </message>
    <message>
        <source>The engine is installed: {}</source>
        <translation>Die Engine ist installiert: {}</translation>
    </message>
    <message>
        <source>The engine is of another version than the plugin; install it again.</source>
        <translation>Die Engine hat eine andere Version als die Erweiterung; installieren Sie sie neu.</translation>
    </message>
    <message>
        <source>The engine is ready: {}</source>
        <translation>Die Engine ist bereit: {}</translation>
    </message>
    <message>
        <source>The engine was removed.</source>
        <translation>Die Engine wurde entfernt.</translation>
    </message>
    <message>
        <source>The semsig command (leave empty to look for it)</source>
        <translation>Der Befehl semsig (leer lassen, um ihn zu suchen)</translation>
    </message>
    <message>
        <source>The tools need an engine: the program semsig in a Python environment of its own, in the folder of your QGIS profile. It takes about 1.2 GB; nothing else on this computer is changed.</source>
        <translation>Die Werkzeuge brauchen eine Engine: das Programm semsig in einer eigenen Python-Umgebung im Ordner Ihres QGIS-Profils. Sie belegt etwa 1,2 GB; sonst wird auf diesem Computer nichts geändert.</translation>
    </message>
    <message>
        <source>This is what is seen from there; change it, or find the place.</source>
        <translation>Das sieht man von dort; ändern Sie es oder suchen Sie den Ort.</translation>
    </message>
    <message>
        <source>Types</source>
        <translation>Arten</translation>
    </message>
    <message>
        <source>Update a signature database</source>
        <translation>Signaturdatenbank aktualisieren</translation>
    </message>
    <message>
        <source>Updated database</source>
        <translation>Aktualisierte Datenbank</translation>
    </message>
    <message>
        <source>Viewpoints</source>
        <translation>Standpunkte</translation>
    </message>
    <message>
        <source>Visibility range (m)</source>
        <translation>Sichtweite (m)</translation>
    </message>
    <message>
        <source>downloaded</source>
        <translation>wird heruntergeladen</translation>
    </message>
    <message>
        <source>looked for</source>
        <translation>wird gesucht</translation>
    </message>
    <message>
        <source>{name}: {cells} cells. Click a cell, or compose what you see.</source>
        <translation>{name}: {cells} Zellen. Klicken Sie eine Zelle an oder stellen Sie zusammen, was Sie sehen.</translation>
    </message>
</context>
</TS>
