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
        <source>A CRS in metres; by default that of the catalogue, or the UTM zone.</source>
        <translation>Ein KBS in Metern; ohne Angabe das des Katalogs oder die UTM-Zone.</translation>
    </message>
    <message>
        <source>A GeoTIFF: for each cell, the number of cells that look the same.</source>
        <translation>Ein GeoTIFF: für jede Zelle die Anzahl der Zellen, die gleich aussehen.</translation>
    </message>
    <message>
        <source>A catalogue file, in addition to the catalogues chosen above or instead of them.</source>
        <translation>Eine Katalogdatei, zusätzlich zu den oben gewählten oder statt ihrer.</translation>
    </message>
    <message>
        <source>A catalogue says which file holds what: the open data of Montpellier and of Paris, and OpenStreetMap, are built in; for other data, write one (“Suggest a catalogue” drafts it).</source>
        <translation>Ein Katalog sagt, welche Datei was enthält: die offenen Daten von Montpellier und Paris und OpenStreetMap sind eingebaut; für andere Daten schreiben Sie einen („Katalog vorschlagen“ entwirft ihn).</translation>
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
        <source>A folder in which the catalogue's files are looked for, instead of files.</source>
        <translation>Ein Ordner, in dem die Dateien des Katalogs gesucht werden, statt einzelner Dateien.</translation>
    </message>
    <message>
        <source>A large city takes minutes. Results that exist are not computed again.</source>
        <translation>Eine große Stadt braucht Minuten. Vorhandene Ergebnisse werden nicht noch einmal berechnet.</translation>
    </message>
    <message>
        <source>A page for the browser with the chances and the candidates.</source>
        <translation>Eine Seite für den Browser mit den Chancen und den Kandidaten.</translation>
    </message>
    <message>
        <source>A page for the browser, on which cells can be clicked.</source>
        <translation>Eine Seite für den Browser, auf der Zellen angeklickt werden können.</translation>
    </message>
    <message>
        <source>A page for the browser: successful and failed queries, and where they fail.</source>
        <translation>Eine Seite für den Browser: erfolgreiche und gescheiterte Anfragen, und wo sie scheitern.</translation>
    </message>
    <message>
        <source>A query counts as found if its best place is at most this far from the true place.</source>
        <translation>Eine Anfrage gilt als gefunden, wenn ihr bester Ort höchstens so weit vom wahren entfernt ist.</translation>
    </message>
    <message>
        <source>A query counts as right if one of this many candidates is right.</source>
        <translation>Eine Anfrage gilt als richtig beantwortet, wenn einer von so vielen Kandidaten stimmt.</translation>
    </message>
    <message>
        <source>A vector file of any format.</source>
        <translation>Eine Vektordatei beliebigen Formats.</translation>
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
        <source>Another number draws other queries.</source>
        <translation>Eine andere Zahl zieht andere Anfragen.</translation>
    </message>
    <message>
        <source>Another number makes another city.</source>
        <translation>Eine andere Zahl ergibt eine andere Stadt.</translation>
    </message>
    <message>
        <source>Another number simulates other queries.</source>
        <translation>Eine andere Zahl simuliert andere Anfragen.</translation>
    </message>
    <message>
        <source>Answer</source>
        <translation>Antwort</translation>
    </message>
    <message>
        <source>Applies new street objects to a database: only the cells that see a change are computed again. The layers of the new objects replace the same layers of the database.</source>
        <translation>Bringt eine Datenbank auf den Stand neuer Straßenobjekte: nur die Zellen, die eine Änderung sehen, werden neu berechnet. Die Layer der neuen Objekte ersetzen die der Datenbank.</translation>
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
        <source>Building footprints to write too, where the files have some. “Build signature database” hides what is behind them.</source>
        <translation>Auch Gebäudegrundrisse schreiben, wo die Dateien welche haben. „Signaturdatenbank aufbauen“ verdeckt, was hinter ihnen liegt.</translation>
    </message>
    <message>
        <source>Building footprints to write too. “Build signature database” hides what is behind them.</source>
        <translation>Auch Gebäudegrundrisse schreiben. „Signaturdatenbank aufbauen“ verdeckt, was hinter ihnen liegt.</translation>
    </message>
    <message>
        <source>Building footprints; objects behind them are not seen.</source>
        <translation>Grundrisse von Gebäuden; Objekte dahinter sind nicht zu sehen.</translation>
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
        <source>Cancelled; the previous state was not changed.</source>
        <translation>Abgebrochen; was vorher da war, ist unverändert.</translation>
    </message>
    <message>
        <source>Candidates</source>
        <translation>Kandidaten</translation>
    </message>
    <message>
        <source>Cannot tell: 90 % of the chance is in {cells} cells, and {chance} within {metres} m of the best place.</source>
        <translation>Nicht zu sagen: 90 % der Wahrscheinlichkeit liegen in {cells} Zellen, und {chance} im Umkreis von {metres} m um den besten Ort.</translation>
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
        <source>Cell {cell} sees {types}; {count} other cells see the same types.</source>
        <translation>Zelle {cell} sieht {types}; {count} andere Zellen sehen dieselben Arten.</translation>
    </message>
    <message>
        <source>Cells</source>
        <translation>Zellen</translation>
    </message>
    <message>
        <source>Cells that see nothing are left out. A folder with the street objects, ready to be searched, is written next to the database; keep it there.</source>
        <translation>Zellen, die nichts sehen, fallen weg. Neben der Datenbank erscheint ein Ordner mit den Straßenobjekten; lassen Sie ihn dort.</translation>
    </message>
    <message>
        <source>Centre lines of streets to write too, where the files have some.</source>
        <translation>Auch Mittellinien von Straßen schreiben, wo die Dateien welche haben.</translation>
    </message>
    <message>
        <source>Centre lines of streets to write too.</source>
        <translation>Auch Mittellinien von Straßen schreiben.</translation>
    </message>
    <message>
        <source>Centre lines, for the viewpoints along streets.</source>
        <translation>Mittellinien, für Standpunkte entlang der Straßen.</translation>
    </message>
    <message>
        <source>Chance</source>
        <translation>Wahrscheinlichkeit</translation>
    </message>
    <message>
        <source>Chance that the regions contain</source>
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
        <source>Choose what you see, and click its direction in the dial. Click an object to remove it.</source>
        <translation>Wählen Sie, was Sie sehen, und klicken Sie seine Richtung in der Windrose an. Ein Klick auf ein Objekt entfernt es.</translation>
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
        <source>Distance around their cells that is searched as well.</source>
        <translation>Abstand um ihre Zellen, in dem auch gesucht wird.</translation>
    </message>
    <message>
        <source>Distortion</source>
        <translation>Verfälschung</translation>
    </message>
    <message>
        <source>Divides the city into square cells and stores for each which street objects are seen from its centre, clockwise from north: its signature. Queries are compared with these signatures.</source>
        <translation>Teilt die Stadt in quadratische Zellen und speichert für jede, welche Straßenobjekte von ihrer Mitte aus zu sehen sind, von Norden an im Uhrzeigersinn: ihre Signatur. Anfragen werden mit diesen Signaturen verglichen.</translation>
    </message>
    <message>
        <source>Download OpenStreetMap for this canvas</source>
        <translation>OpenStreetMap für diesen Kartenausschnitt laden</translation>
    </message>
    <message>
        <source>Downloads the street objects of OpenStreetMap (trees, lamps, benches, stops...) in a part of the map, from an Overpass server, into a table that “Build signature database” takes.</source>
        <translation>Lädt die Straßenobjekte von OpenStreetMap (Bäume, Laternen, Bänke, Haltestellen …) in einem Teil der Karte von einem Overpass-Server herunter, in eine Tabelle für „Signaturdatenbank aufbauen“.</translation>
    </message>
    <message>
        <source>Downloads the street objects of a city: by its name, or in the polygons of a layer. A catalogue says from where: OpenStreetMap has every place; a city's own portal has more of that city.</source>
        <translation>Lädt die Straßenobjekte einer Stadt herunter: nach ihrem Namen oder in den Polygonen eines Layers. Ein Katalog sagt, woher: OpenStreetMap kennt jeden Ort; das Portal einer Stadt hat mehr von dieser Stadt.</translation>
    </message>
    <message>
        <source>Drafts a catalogue for a file of your own: which column contains the kind of an object, and which class of street objects each of its values may be. Check and correct the draft in a text editor, and give it to “Load street objects” as a catalogue of your own.</source>
        <translation>Entwirft einen Katalog für eine eigene Datei: welche Spalte die Art eines Objekts enthält, und welche Klasse von Straßenobjekten jeder ihrer Werte sein könnte. Prüfen und verbessern Sie den Entwurf in einem Texteditor, und geben Sie ihn „Straßenobjekte laden“ als eigenen Katalog.</translation>
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
        <source>Every cell, outdoor cells, or outdoor cells near streets.</source>
        <translation>Alle Zellen, Zellen außerhalb der Gebäude, oder Zellen an Straßen und außerhalb der Gebäude.</translation>
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
        <source>Finds where in the city a view was taken from: what is seen, clockwise from north, is compared with the signature of every cell. Types without bearings, or bearings without types, are enough.</source>
        <translation>Findet, von wo in der Stadt eine Ansicht stammt: was zu sehen ist, von Norden an im Uhrzeigersinn, wird mit der Signatur jeder Zelle verglichen. Typen ohne Richtungen oder Richtungen ohne Typen genügen.</translation>
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
        <source>Folder to write to.</source>
        <translation>Der Ordner, in den geschrieben wird.</translation>
    </message>
    <message>
        <source>For files that do not state theirs.</source>
        <translation>Für Dateien, die ihres nicht angeben.</translation>
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
        <source>How cells are compared with a query. likelihood: by the chance that a detector sees the query from there. edit+edit: by the number of objects to add, remove or exchange to change one sequence into the other, the mean of types and angles. edit+edit:5%: the same, among the 5 % of the cells with the best types. histogram+histogram: by how often each type and each angle occurs, in any order. jaccard+jaccard: by which types and which angles occur at all. types:edit and angles:edit: as edit+edit, by only the types or only the angles.</source>
        <translation>Wie Zellen mit einer Anfrage verglichen werden. likelihood: nach der Chance, dass ein Detektor die Anfrage von dort sieht. edit+edit: danach, wie viele Objekte hinzukommen, wegfallen oder getauscht werden müssen, um die eine Folge in die andere zu verwandeln, im Mittel von Typen und Winkeln. edit+edit:5%: dasselbe unter den 5 % der Zellen, deren Typen am besten passen. histogram+histogram: danach, wie oft jeder Typ und jeder Winkel vorkommt, gleich in welcher Reihenfolge. jaccard+jaccard: danach, welche Typen und welche Winkel überhaupt vorkommen. types:edit und angles:edit: wie edit+edit, nach den Typen oder den Winkeln allein.</translation>
    </message>
    <message>
        <source>How many places (with likelihood) or cells to list at most.</source>
        <translation>Wie viele Orte (bei likelihood) oder Zellen höchstens aufgeführt werden.</translation>
    </message>
    <message>
        <source>How many objects the detector gets wrong: none, 1, 7 or 13.</source>
        <translation>Bei wie vielen Objekten der Detektor sich irrt: keinem, 1, 7 oder 13.</translation>
    </message>
    <message>
        <source>How many queries are asked.</source>
        <translation>Wie viele Anfragen gestellt werden.</translation>
    </message>
    <message>
        <source>How much of what is seen will be wrong: light, medium, strong, or generic where that is not known, by-hand for what a person notes down.</source>
        <translation>Wie viel von dem Gesehenen falsch sein wird: light (wenig), medium (mittel), strong (viel) oder generic, wo das nicht bekannt ist; by-hand für das, was ein Mensch notiert.</translation>
    </message>
    <message>
        <source>If “Where queries can be placed” was run, its results are written with the cells.</source>
        <translation>Wurde „Wo Anfragen verortet werden können“ ausgeführt, stehen die Ergebnisse bei den Zellen.</translation>
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
        <source>Its square, or its centre.</source>
        <translation>Ihr Quadrat oder ihre Mitte.</translation>
    </message>
    <message>
        <source>Largest distance from which an object is seen, unless the catalogue gives one for its class.</source>
        <translation>Größte Entfernung, aus der ein Objekt zu sehen ist, wenn der Katalog keine für seine Klasse nennt.</translation>
    </message>
    <message>
        <source>Looking for Python...</source>
        <translation>Python wird gesucht ...</translation>
    </message>
    <message>
        <source>Makes up a small city, builds its database, evaluates queries and shows the results: to try the tools without data or a network. The folder contains city.parquet for the other tools.</source>
        <translation>Erfindet eine kleine Stadt, baut ihre Datenbank, wertet Anfragen aus und zeigt die Ergebnisse: zum Ausprobieren, ohne Daten und Netz. Der Ordner enthält city.parquet für die anderen Werkzeuge.</translation>
    </message>
    <message>
        <source>Map page</source>
        <translation>Kartenseite</translation>
    </message>
    <message>
        <source>Measures how often answers are right. Cells are drawn as queries, their signatures are distorted as a bad detector would (objects missed, made up or misnamed, bearings off), and the best answer is compared with the true place.</source>
        <translation>Misst, wie oft Antworten stimmen. Zellen werden als Anfragen gezogen, ihre Signaturen verfälscht, wie ein schlechter Detektor es täte (Objekte übersehen, erfunden oder falsch benannt, Richtungen ungenau), und die beste Antwort wird mit dem wahren Ort verglichen.</translation>
    </message>
    <message>
        <source>Method</source>
        <translation>Methode</translation>
    </message>
    <message>
        <source>More distortions of a query, separated by commas, such as compass:10,view:90 (a compass that is off by 10°, a view of 90°).</source>
        <translation>Weitere Störungen einer Anfrage, durch Kommas getrennt, etwa compass:10,view:90 (ein Kompass, der um 10° abweicht, ein Blickfeld von 90°).</translation>
    </message>
    <message>
        <source>Name of a city or quarter, such as Gentilly, France.</source>
        <translation>Name einer Stadt oder eines Viertels, etwa Gentilly, France.</translation>
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
        <source>Number of equal sectors in which the methods of the paper compare bearings. More sectors distinguish cells better, but tolerate smaller errors of bearings.</source>
        <translation>Anzahl gleicher Sektoren, in denen die Verfahren des Aufsatzes Richtungen vergleichen. Mehr Sektoren unterscheiden Zellen besser, vertragen aber nur kleinere Fehler der Richtungen.</translation>
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
        <source>Polygons instead of a name.</source>
        <translation>Polygone statt eines Namens.</translation>
    </message>
    <message>
        <source>Polygons that the cells must lie in.</source>
        <translation>Polygone, in denen die Zellen liegen müssen.</translation>
    </message>
    <message>
        <source>Predicts for every cell how likely a query from there will be found, and which other cells it may be confused with. A street with three lamps looks like thousands of others; this tool shows them.</source>
        <translation>Sagt für jede Zelle voraus, wie wahrscheinlich eine Anfrage von dort gefunden wird und mit welchen anderen Zellen man sie verwechseln kann. Eine Straße mit drei Laternen sieht aus wie tausend andere; dieses Werkzeug zeigt sie.</translation>
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
        <source>Reads files of open data (trees, street lights, benches, bus stops...) into one table of street objects, which “Build signature database” takes.</source>
        <translation>Liest Dateien offener Daten (Bäume, Laternen, Bänke, Bushaltestellen …) in eine Tabelle von Straßenobjekten für „Signaturdatenbank aufbauen“.</translation>
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
        <source>Shows how many cells see the same types in the same order: a unique cell can be identified at once, one of a thousand cannot. “Where queries can be placed” gives more detail, and takes longer.</source>
        <translation>Zeigt, wie viele Zellen dieselben Typen in derselben Reihenfolge sehen: eine einmalige Zelle erkennt man sofort, eine von tausend nicht. „Wo Anfragen verortet werden können“ sagt mehr und dauert länger.</translation>
    </message>
    <message>
        <source>Shows what is seen from a cell, and the most similar cells.</source>
        <translation>Zeigt, was man aus einer Zelle sieht, und die ähnlichsten Zellen.</translation>
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
        <source>Some square kilometres take seconds to minutes. What was downloaded before is taken from the cache. The server is a setting: Settings &gt; Options &gt; Processing &gt; Providers &gt; Semantic signatures.</source>
        <translation>Einige Quadratkilometer brauchen Sekunden bis Minuten. Was schon heruntergeladen wurde, kommt aus dem Zwischenspeicher. Der Server wird eingestellt unter Einstellungen &gt; Optionen &gt; Verarbeitung &gt; Anbieter &gt; Semantische Signaturen.</translation>
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
        <source>Such as M (a bus stop), 2B (two trees or more), B=0 (no tree), ?&lt;=10 (ten objects or fewer).</source>
        <translation>Etwa M (eine Bushaltestelle), 2B (zwei Bäume oder mehr), B=0 (kein Baum), ?&lt;=10 (höchstens zehn Objekte).</translation>
    </message>
    <message>
        <source>Suggest a catalogue</source>
        <translation>Katalog vorschlagen</translation>
    </message>
    <message>
        <source>Symbols of what is seen, clockwise from north, such as DDBL; ? where one is unknown. The paper's: B tree, C fountain, D street light, E indicator, G traffic light, H bike station, I public toilet, J car sharing, K taxi rank, L bench, M bus stop; a catalogue may have more.</source>
        <translation>Symbole dessen, was zu sehen ist, von Norden an im Uhrzeigersinn, etwa DDBL; ? für ein unbekanntes. Die des Aufsatzes: B Baum, C Brunnen, D Laterne, E Anzeiger, G Ampel, H Fahrradstation, I öffentliche Toilette, J Carsharing, K Taxistand, L Bank, M Bushaltestelle; ein Katalog kann mehr haben.</translation>
    </message>
    <message>
        <source>The GeoPackage to write.</source>
        <translation>Das GeoPackage, das geschrieben wird.</translation>
    </message>
    <message>
        <source>The best places or cells.</source>
        <translation>Die besten Orte oder Zellen.</translation>
    </message>
    <message>
        <source>The catalogues of the files. With several, objects that two of them contain are merged; the first is treated as the best source.</source>
        <translation>Die Kataloge der Dateien. Bei mehreren werden Objekte, die zwei davon haben, zusammengelegt; der erste gilt als beste Quelle.</translation>
    </message>
    <message>
        <source>The cells and the street objects as layers, in a GeoPackage.</source>
        <translation>Die Zellen und die Straßenobjekte als Layer, in einem GeoPackage.</translation>
    </message>
    <message>
        <source>The cells by their chance, in a GeoPackage.</source>
        <translation>Die Zellen nach ihrer Chance, in einem GeoPackage.</translation>
    </message>
    <message>
        <source>The places that a view from here may be confused with, by chance:</source>
        <translation>Die Orte, mit denen eine Ansicht von hier verwechselt werden kann, nach Wahrscheinlichkeit:</translation>
    </message>
    <message>
        <source>The database to write.</source>
        <translation>Die Datenbank, die geschrieben wird.</translation>
    </message>
    <message>
        <source>The database to write. A temporary file is lost when QGIS is closed.</source>
        <translation>Die Datenbank, die geschrieben wird. Eine temporäre Datei geht verloren, wenn QGIS beendet wird.</translation>
    </message>
    <message>
        <source>The direction of each object, in degrees clockwise from north, separated by commas, such as 10,80,200,310.</source>
        <translation>Die Richtung jedes Objekts, in Grad von Norden im Uhrzeigersinn, durch Kommas getrennt, etwa 10,80,200,310.</translation>
    </message>
    <message>
        <source>The draft to write.</source>
        <translation>Der Entwurf, der geschrieben wird.</translation>
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
        <source>The extent to download; by default the extent of the canvas.</source>
        <translation>Der Ausschnitt, der heruntergeladen wird; ohne Angabe der Ausschnitt der Karte.</translation>
    </message>
    <message>
        <source>The file that “Build signature database” wrote.</source>
        <translation>Die Datei, die „Signaturdatenbank aufbauen“ geschrieben hat.</translation>
    </message>
    <message>
        <source>The file that “Load street objects” wrote, for a second layer.</source>
        <translation>Die Datei, die „Straßenobjekte laden“ geschrieben hat, für einen zweiten Layer.</translation>
    </message>
    <message>
        <source>The file that “Load street objects” wrote.</source>
        <translation>Die Datei, die „Straßenobjekte laden“ geschrieben hat.</translation>
    </message>
    <message>
        <source>The likelihood method gives each candidate a chance, estimates the place between the centres of cells with its uncertainty, and reports when it cannot decide. The other methods are from the paper; they rank cells by a distance, and cells that look the same share a rank.</source>
        <translation>Das Verfahren likelihood gibt jedem Kandidaten eine Chance, schätzt den Ort zwischen den Mitten der Zellen mit seiner Unsicherheit und meldet, wenn es nicht entscheiden kann. Die anderen Verfahren sind aus dem Aufsatz; sie ordnen Zellen nach einer Distanz, und Zellen, die gleich aussehen, teilen einen Rang.</translation>
    </message>
    <message>
        <source>The log has a table of the results; the folder contains them for other programs, and the layers and the map page show them.</source>
        <translation>Im Protokoll steht eine Tabelle der Ergebnisse; der Ordner enthält sie für andere Programme, die Layer und die Kartenseite zeigen sie.</translation>
    </message>
    <message>
        <source>The log reports how many rows became objects, how many were left out, and why.</source>
        <translation>Das Protokoll meldet, wie viele Zeilen Objekte wurden, wie viele wegfielen, und warum.</translation>
    </message>
    <message>
        <source>The new objects: the file that “Load street objects” or a download wrote.</source>
        <translation>Die neuen Objekte: die Datei, die „Straßenobjekte laden“ oder ein Download geschrieben hat.</translation>
    </message>
    <message>
        <source>The paper of Weng, Gouet-Brunet and Soheilian uses 10 m.</source>
        <translation>Im Aufsatz von Weng, Gouet-Brunet und Soheilian sind es 10 m.</translation>
    </message>
    <message>
        <source>The parts of the city to search for the query, in a GeoPackage.</source>
        <translation>Die Teile der Stadt, die für die Anfrage abgesucht werden müssen, in einem GeoPackage.</translation>
    </message>
    <message>
        <source>The queries at their true places, and lines to the places that were found, in a GeoPackage.</source>
        <translation>Die Anfragen an ihren wahren Orten und Linien zu den gefundenen, in einem GeoPackage.</translation>
    </message>
    <message>
        <source>The queries, their errors and a summary, for other programs.</source>
        <translation>Die Anfragen, ihre Fehler und eine Zusammenfassung, für andere Programme.</translation>
    </message>
    <message>
        <source>The results become columns of the database, and the cells are shown by their chance. The map page, which opens in a browser, shows on a click which cells a cell may be confused with.</source>
        <translation>Die Ergebnisse werden Spalten der Datenbank, und die Zellen werden nach ihrer Chance gezeigt. Die Kartenseite für den Browser zeigt auf einen Klick, mit welchen Zellen eine Zelle verwechselt werden kann.</translation>
    </message>
    <message>
        <source>The semsig command (leave empty to look for it)</source>
        <translation>Der Befehl semsig (leer lassen, um ihn zu suchen)</translation>
    </message>
    <message>
        <source>The table of street objects to write. A temporary file is lost when QGIS is closed.</source>
        <translation>Die Tabelle der Straßenobjekte, die geschrieben wird. Eine temporäre Datei geht verloren, wenn QGIS beendet wird.</translation>
    </message>
    <message>
        <source>The tools need an engine: the program semsig in a Python environment of its own, in the folder of your QGIS profile. It takes about 1 GB; nothing else on this computer is changed.</source>
        <translation>Die Werkzeuge brauchen eine Engine: das Programm semsig in einer eigenen Python-Umgebung im Ordner Ihres QGIS-Profils. Sie belegt etwa 1 GB; sonst wird auf diesem Computer nichts geändert.</translation>
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
        <source>Vector files of any format, .osm or .osm.pbf; zipped is fine.</source>
        <translation>Vektordateien beliebigen Formats, .osm oder .osm.pbf; auch gezippt.</translation>
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
        <source>Where the data come from.</source>
        <translation>Woher die Daten kommen.</translation>
    </message>
    <message>
        <source>With likelihood and an uncertain north, the standard deviation.</source>
        <translation>Bei likelihood und unsicherem Norden: die Standardabweichung.</translation>
    </message>
    <message>
        <source>With likelihood, how much of what is seen may be wrong: light, medium, strong, or generic where that is not known, by-hand for what a person noted down.</source>
        <translation>Bei likelihood: wie viel von dem Gesehenen falsch sein kann: light (wenig), medium (mittel), strong (viel) oder generic, wo das nicht bekannt ist; by-hand für das, was ein Mensch notiert hat.</translation>
    </message>
    <message>
        <source>With likelihood, whether the north is known.</source>
        <translation>Bei likelihood: ob Norden bekannt ist.</translation>
    </message>
    <message>
        <source>With likelihood: polygons that the place lies in.</source>
        <translation>Bei likelihood: Polygone, in denen der Ort liegt.</translation>
    </message>
    <message>
        <source>With likelihood: the ellipse in which the place lies with a chance of 90 %, if the answer is right.</source>
        <translation>Bei likelihood: die Ellipse, in der der Ort mit einer Chance von 90 % liegt, wenn die Antwort stimmt.</translation>
    </message>
    <message>
        <source>With likelihood: the regions are as large as needed to contain this chance, 0.9 by default.</source>
        <translation>Bei likelihood: die Regionen sind so groß, dass sie diese Chance enthalten, ohne Angabe 0,9.</translation>
    </message>
    <message>
        <source>Writes the cells of a database to a GeoPackage: what is seen from each, clockwise from north, and how many other cells look the same; with the street objects, these become a second layer.</source>
        <translation>Schreibt die Zellen einer Datenbank in ein GeoPackage: was von jeder aus zu sehen ist, von Norden an im Uhrzeigersinn, und wie viele andere Zellen gleich aussehen; werden die Straßenobjekte angegeben, so werden sie ein zweiter Layer.</translation>
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
