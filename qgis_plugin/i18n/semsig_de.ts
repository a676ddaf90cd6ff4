<?xml version="1.0" encoding="utf-8"?>
<!DOCTYPE TS>
<TS version="2.1" language="de" sourcelanguage="en">
<context>
    <name>Semsig</name>
    <message>
        <source>0.9</source>
        <translation>0,9</translation>
    </message>
    <message>
        <source>10 from EXIF; otherwise left to semsig localize</source>
        <translation>10 bei EXIF; sonst entscheidet semsig localize</translation>
    </message>
    <message>
        <source>250, or more where queries are few</source>
        <translation>250, oder mehr, wo es wenige Anfragen gibt</translation>
    </message>
    <message>
        <source>A cell must see</source>
        <translation>Eine Zelle muss sehen</translation>
    </message>
    <message>
        <source>A unique cell can be identified at once, one of a thousand cannot. The raster holds, for each cell, the number of cells that look the same. `semsig identify` gives more detail, and takes longer.</source>
        <translation>Eine einmalige Zelle erkennt man sofort, eine von tausend nicht. Das Raster enthält für jede Zelle die Anzahl der Zellen, die gleich aussehen. `semsig identify` sagt mehr und dauert länger.</translation>
    </message>
    <message>
        <source>Adapt the errors to the queries</source>
        <translation>Fehler an die Anfragen anpassen</translation>
    </message>
    <message>
        <source>Adapt the noise to all --queries first, which are views of one camera and detector.</source>
        <translation>Das Fehlermodell zuerst an alle --queries anpassen, die Ansichten einer Kamera und eines Detektors sind.</translation>
    </message>
    <message>
        <source>Address of a Dask scheduler.</source>
        <translation>Adresse eines Dask-Schedulers.</translation>
    </message>
    <message>
        <source>Address of a server to use instead of the catalogue's.</source>
        <translation>Adresse eines Servers, der statt des Servers des Katalogs verwendet wird.</translation>
    </message>
    <message>
        <source>Adds columns to the database, which `semsig info`, `map` and `export` show.</source>
        <translation>Fügt der Datenbank Spalten hinzu, die `semsig info`, `map` und `export` zeigen.</translation>
    </message>
    <message>
        <source>Age of the map</source>
        <translation>Alter der Karte</translation>
    </message>
    <message>
        <source>Age of the map, from the survey of its objects to the query.</source>
        <translation>Alter der Karte, von der Aufnahme ihrer Objekte bis zur Anfrage.</translation>
    </message>
    <message>
        <source>All layers</source>
        <translation>Alle Layer</translation>
    </message>
    <message>
        <source>Also remove the street objects, which updates and refined places need.</source>
        <translation>Auch die Straßenobjekte entfernen, die Aktualisierungen und verfeinerte Orte brauchen.</translation>
    </message>
    <message>
        <source>Also search between the centres of cells.</source>
        <translation>Auch zwischen den Mitten der Zellen suchen.</translation>
    </message>
    <message>
        <source>Also the street objects</source>
        <translation>Auch die Straßenobjekte</translation>
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
        <source>Angle that the camera is rolled clockwise.</source>
        <translation>Winkel, um den die Kamera im Uhrzeigersinn gedreht ist.</translation>
    </message>
    <message>
        <source>Angle that the camera points upwards.</source>
        <translation>Winkel, um den die Kamera nach oben zeigt.</translation>
    </message>
    <message>
        <source>Another signature database, built in the same way.</source>
        <translation>Eine andere Signaturdatenbank, die ebenso aufgebaut wurde.</translation>
    </message>
    <message>
        <source>Answer</source>
        <translation>Antwort</translation>
    </message>
    <message>
        <source>Apply changed street objects to a database.</source>
        <translation>Bringt eine Datenbank auf den Stand geänderter Straßenobjekte.</translation>
    </message>
    <message>
        <source>Apply the catalogue's filters.</source>
        <translation>Die Filter des Katalogs anwenden.</translation>
    </message>
    <message>
        <source>Area</source>
        <translation>Gebiet</translation>
    </message>
    <message>
        <source>Area to keep</source>
        <translation>Gebiet, das bleibt</translation>
    </message>
    <message>
        <source>Ask</source>
        <translation>Fragen</translation>
    </message>
    <message>
        <source>Assume that views are from the area of the database. Otherwise the chance that they are from elsewhere is 50 % before their objects are compared.</source>
        <translation>Annehmen, dass Ansichten aus dem Gebiet der Datenbank stammen. Sonst ist die Wahrscheinlichkeit, dass sie von woanders stammen, 50 %, bevor ihre Objekte verglichen werden.</translation>
    </message>
    <message>
        <source>Assume that views are from the centre of a cell, as in the paper, instead of from anywhere in it.</source>
        <translation>Annehmen, dass Ansichten wie im Aufsatz aus der Mitte einer Zelle stammen, statt von irgendwo in ihr.</translation>
    </message>
    <message>
        <source>At places every 10 m along the streets, the objects in sight are counted, and then what optional layers add. Where few are seen, a view fits many places.</source>
        <translation>An Stellen alle 10 m entlang der Straßen werden die sichtbaren Objekte gezählt, und danach, was optionale Layer hinzufügen. Wo wenige zu sehen sind, passt eine Ansicht zu vielen Orten.</translation>
    </message>
    <message>
        <source>Bearing of the middle of the photo.</source>
        <translation>Richtung der Mitte des Fotos.</translation>
    </message>
    <message>
        <source>Bearing of the photo</source>
        <translation>Blickrichtung des Fotos</translation>
    </message>
    <message>
        <source>Bearings</source>
        <translation>Richtungen</translation>
    </message>
    <message>
        <source>Benchmark on photographs</source>
        <translation>Vergleich auf Fotos</translation>
    </message>
    <message>
        <source>Best place: {place}</source>
        <translation>Bester Ort: {place}</translation>
    </message>
    <message>
        <source>Box in degrees, a polygon file, or the name of a place.</source>
        <translation>Rechteck in Grad, eine Datei mit Polygonen oder der Name eines Ortes.</translation>
    </message>
    <message>
        <source>Build a signature database from street objects.</source>
        <translation>Baut eine Signaturdatenbank aus Straßenobjekten auf.</translation>
    </message>
    <message>
        <source>Build signature database</source>
        <translation>Signaturdatenbank aufbauen</translation>
    </message>
    <message>
        <source>Building footprints that hide what is behind them.</source>
        <translation>Gebäudegrundrisse, die verdecken, was hinter ihnen liegt.</translation>
    </message>
    <message>
        <source>Building footprints to write (.parquet).</source>
        <translation>Gebäudegrundrisse, die geschrieben werden (.parquet).</translation>
    </message>
    <message>
        <source>Buildings</source>
        <translation>Gebäude</translation>
    </message>
    <message>
        <source>Buildings and streets</source>
        <translation>Gebäude und Straßen</translation>
    </message>
    <message>
        <source>Buildings and streets of the street objects</source>
        <translation>Gebäude und Straßen der Straßenobjekte</translation>
    </message>
    <message>
        <source>By likelihood, every place gets a chance. A method by distance takes only what was seen and --require of what is known, and cannot explain.</source>
        <translation>Mit der Methode likelihood bekommt jeder Ort eine Wahrscheinlichkeit. Eine Methode nach Abstand nutzt nur, was zu sehen war, und vom Bekannten --require, und kann nichts erklären.</translation>
    </message>
    <message>
        <source>CRS in metres to work in.</source>
        <translation>KBS in Metern, in dem gearbeitet wird.</translation>
    </message>
    <message>
        <source>CRS of files that do not state their own, such as EPSG:2154.</source>
        <translation>KBS von Dateien, die ihres nicht angeben, etwa EPSG:2154.</translation>
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
        <source>Calibrate the answers</source>
        <translation>Antworten kalibrieren</translation>
    </message>
    <message>
        <source>Camera data</source>
        <translation>Kameradaten</translation>
    </message>
    <message>
        <source>Camera data of single pictures: a CSV or JSON lines file with image and any of camera, fov, heading, heading_error, pitch, roll and place.</source>
        <translation>Kameradaten einzelner Bilder: eine Datei mit CSV oder JSON-Zeilen mit image und beliebigen von camera, fov, heading, heading_error, pitch, roll und place.</translation>
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
        <source>Candidates that count</source>
        <translation>Kandidaten, die zählen</translation>
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
        <source>Catalogue with a service, by name or .toml.</source>
        <translation>Katalog mit einem Dienst, nach Namen oder als .toml.</translation>
    </message>
    <message>
        <source>Catalogue, by name or .toml file; default: list all.</source>
        <translation>Katalog, nach Namen oder als .toml-Datei; ohne Angabe werden alle aufgeführt.</translation>
    </message>
    <message>
        <source>Catalogue, by name or .toml file; not needed for OpenStreetMap and Overture. Repeat to merge several, best first.</source>
        <translation>Katalog, nach Namen oder als .toml-Datei; für OpenStreetMap und Overture nicht nötig. Mehrere werden zusammengelegt, der beste zuerst.</translation>
    </message>
    <message>
        <source>Catalogues</source>
        <translation>Kataloge</translation>
    </message>
    <message>
        <source>Catalogues of open data</source>
        <translation>Kataloge offener Daten</translation>
    </message>
    <message>
        <source>Cells</source>
        <translation>Zellen</translation>
    </message>
    <message>
        <source>Centre lines of streets to write (.parquet).</source>
        <translation>Mittellinien von Straßen, die geschrieben werden (.parquet).</translation>
    </message>
    <message>
        <source>Centre lines of streets, for maps, names of places and viewpoints near streets.</source>
        <translation>Mittellinien von Straßen, für Karten, Namen von Orten und Standpunkte an Straßen.</translation>
    </message>
    <message>
        <source>Centre lines to draw below the map.</source>
        <translation>Mittellinien, die unter die Karte gezeichnet werden.</translation>
    </message>
    <message>
        <source>Chance</source>
        <translation>Wahrscheinlichkeit</translation>
    </message>
    <message>
        <source>Chance of the regions</source>
        <translation>Wahrscheinlichkeit der Gebiete</translation>
    </message>
    <message>
        <source>Changes</source>
        <translation>Änderungen</translation>
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
        <source>Choose from which chance on a place is given as an answer.</source>
        <translation>Wählt, ab welcher Wahrscheinlichkeit ein Ort als Antwort genannt wird.</translation>
    </message>
    <message>
        <source>Choose what you see, and click its direction in the dial. Click an object to remove it.</source>
        <translation>Wählen Sie, was Sie sehen, und klicken Sie seine Richtung in der Windrose an. Ein Klick auf ein Objekt entfernt es.</translation>
    </message>
    <message>
        <source>Class of false objects</source>
        <translation>Klasse falscher Objekte</translation>
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
        <source>Collapse objects of a class</source>
        <translation>Objekte einer Klasse zusammenfassen</translation>
    </message>
    <message>
        <source>Collapse objects of a class at the same place.</source>
        <translation>Objekte einer Klasse am selben Ort zusammenfassen.</translation>
    </message>
    <message>
        <source>Compare results</source>
        <translation>Ergebnisse vergleichen</translation>
    </message>
    <message>
        <source>Compare two results of queries from the same places.</source>
        <translation>Vergleicht zwei Ergebnisse von Anfragen von denselben Orten.</translation>
    </message>
    <message>
        <source>Composes the view that is seen from a place of the map.</source>
        <translation>Stellt zusammen, was man von einer Stelle der Karte aus sieht.</translation>
    </message>
    <message>
        <source>Corner of a cell in metres, in the CRS of the objects.</source>
        <translation>Ecke einer Zelle in Metern, im KBS der Objekte.</translation>
    </message>
    <message>
        <source>Count the best of this many candidates (t).</source>
        <translation>Den besten von so vielen Kandidaten zählen (t).</translation>
    </message>
    <message>
        <source>Data set</source>
        <translation>Datensatz</translation>
    </message>
    <message>
        <source>Data set: flatlandia or london-lights.</source>
        <translation>Datensatz: flatlandia oder london-lights.</translation>
    </message>
    <message>
        <source>Database of another city</source>
        <translation>Datenbank einer anderen Stadt</translation>
    </message>
    <message>
        <source>Database of another city: also count how many of its views are answered, which is wrong for all of them.</source>
        <translation>Datenbank einer anderen Stadt: auch zählen, wie viele ihrer Ansichten beantwortet werden, was bei allen falsch ist.</translation>
    </message>
    <message>
        <source>Database to write.</source>
        <translation>Datenbank, die geschrieben wird.</translation>
    </message>
    <message>
        <source>Day of the view</source>
        <translation>Tag der Ansicht</translation>
    </message>
    <message>
        <source>Day of the view, for magnetic north.</source>
        <translation>Tag der Ansicht, für magnetischen Norden.</translation>
    </message>
    <message>
        <source>Default street width, where --streets has none.</source>
        <translation>Straßenbreite, wo --streets keine angibt.</translation>
    </message>
    <message>
        <source>Default: {}.</source>
        <translation>Ohne Angabe: {}.</translation>
    </message>
    <message>
        <source>Degrees clockwise from north, such as 10,80,200,310.</source>
        <translation>Grad von Norden an im Uhrzeigersinn, etwa 10,80,200,310.</translation>
    </message>
    <message>
        <source>Demonstration</source>
        <translation>Vorführung</translation>
    </message>
    <message>
        <source>Detections of known places</source>
        <translation>Detektionen bekannter Orte</translation>
    </message>
    <message>
        <source>Detections of known places: a CSV or JSON lines file of views with x and y (metres) or cell_id (its centre).</source>
        <translation>Detektionen bekannter Orte: eine Datei von Ansichten als CSV oder JSON-Zeilen mit x und y (Meter) oder cell_id (ihrer Mitte).</translation>
    </message>
    <message>
        <source>Detections: COCO, Label Studio, LabelMe, VIA, Supervisely, Darwin, Datumaro, BDD100K, Mapillary, Panoramax, Ultralytics, Transformers or supervision JSON, answers of Rekognition, Vision or Roboflow, CVAT or Pascal VOC XML, YOLO .txt with data.yaml, KITTI .txt, CSV of Roboflow or Label Studio; or a folder. With --detector: photographs, or folders of them.</source>
        <translation>Detektionen: COCO, Label Studio, LabelMe, VIA, Supervisely, Darwin, Datumaro, BDD100K, Mapillary, Panoramax, Ultralytics, Transformers oder supervision JSON, Antworten von Rekognition, Vision oder Roboflow, CVAT oder Pascal VOC XML, YOLO .txt mit data.yaml, KITTI .txt, CSV von Roboflow oder Label Studio; oder ein Ordner. Mit --detector: Fotos oder Ordner mit Fotos.</translation>
    </message>
    <message>
        <source>Direction of the camera, clockwise from north.</source>
        <translation>Richtung der Kamera, von Norden an im Uhrzeigersinn.</translation>
    </message>
    <message>
        <source>Distance to add around the cells of --out.</source>
        <translation>Abstand, der um die Zellen von --out hinzukommt.</translation>
    </message>
    <message>
        <source>Distort queries: none, light, medium or strong, or several, such as medium,compass:10,view:90.</source>
        <translation>Anfragen verfälschen: none (gar nicht), light (wenig), medium (mittel) oder strong (stark), oder mehrere, etwa medium,compass:10,view:90.</translation>
    </message>
    <message>
        <source>Distortion</source>
        <translation>Verfälschung</translation>
    </message>
    <message>
        <source>Do not sort the objects again after the bearing noise.</source>
        <translation>Die Objekte nach den Fehlern der Richtungen nicht neu ordnen.</translation>
    </message>
    <message>
        <source>Download OpenStreetMap for this canvas</source>
        <translation>OpenStreetMap für diesen Kartenausschnitt laden</translation>
    </message>
    <message>
        <source>Download street objects</source>
        <translation>Straßenobjekte herunterladen</translation>
    </message>
    <message>
        <source>Download the street objects of OpenStreetMap in a part of the map, from an Overpass server.</source>
        <translation>Lädt die Straßenobjekte von OpenStreetMap in einem Teil der Karte von einem Overpass-Server herunter.</translation>
    </message>
    <message>
        <source>Download the street objects of an area.</source>
        <translation>Lädt die Straßenobjekte eines Gebiets herunter.</translation>
    </message>
    <message>
        <source>Draft a catalogue</source>
        <translation>Katalog entwerfen</translation>
    </message>
    <message>
        <source>Draft a catalogue for a vector file or a folder of files, for you to edit.</source>
        <translation>Entwirft einen Katalog für eine Vektordatei oder einen Ordner mit Dateien, den Sie bearbeiten.</translation>
    </message>
    <message>
        <source>Draw a map</source>
        <translation>Karte zeichnen</translation>
    </message>
    <message>
        <source>Draw an answer: the .tif file that `semsig localize --out` wrote.</source>
        <translation>Eine Antwort zeichnen: die .tif-Datei, die `semsig localize --out` geschrieben hat.</translation>
    </message>
    <message>
        <source>Draw cells, evaluations, changes, answers or objects on a map.</source>
        <translation>Zeichnet Zellen, Auswertungen, Änderungen, Antworten oder Objekte auf eine Karte.</translation>
    </message>
    <message>
        <source>Draw how many cells look the same.</source>
        <translation>Zeichnen, wie viele Zellen gleich aussehen.</translation>
    </message>
    <message>
        <source>Draw how well cells can be found (after `semsig identify`).</source>
        <translation>Zeichnen, wie gut Zellen gefunden werden können (nach `semsig identify`).</translation>
    </message>
    <message>
        <source>Draw online tiles below the map, of a provider of xyzservices that needs no key, such as OpenStreetMap.Mapnik.</source>
        <translation>Online-Kacheln unter die Karte zeichnen, von einem Anbieter aus xyzservices, der keinen Schlüssel verlangt, etwa OpenStreetMap.Mapnik.</translation>
    </message>
    <message>
        <source>Draw street objects written by `semsig load`.</source>
        <translation>Straßenobjekte zeichnen, die `semsig load` geschrieben hat.</translation>
    </message>
    <message>
        <source>Draw the changes up to this newer database.</source>
        <translation>Die Änderungen bis zu dieser neueren Datenbank zeichnen.</translation>
    </message>
    <message>
        <source>Ellipse of the place</source>
        <translation>Ellipse des Orts</translation>
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
        <source>Error of the heading</source>
        <translation>Fehler der Blickrichtung</translation>
    </message>
    <message>
        <source>Errors of the detector</source>
        <translation>Fehler des Detektors</translation>
    </message>
    <message>
        <source>Errors of the detector or person: light, medium, strong, generic (any of them), by-hand, photo, panorama, or a file written by `semsig learn`.</source>
        <translation>Fehler des Detektors oder Menschen: light (wenige), medium (mittel), strong (viele), generic (eins davon), by-hand, photo, panorama oder eine Datei, die `semsig learn` geschrieben hat.</translation>
    </message>
    <message>
        <source>Errors of the detector: light, medium, strong, generic (any of them), by-hand (a person, who leaves some out), photo, panorama, or a file written by `semsig learn`.</source>
        <translation>Fehler des Detektors: light (wenige), medium (mittel), strong (viele), generic (eins davon), by-hand (ein Mensch, der manche weglässt), photo, panorama oder eine Datei, die `semsig learn` geschrieben hat.</translation>
    </message>
    <message>
        <source>Evaluate</source>
        <translation>Auswerten</translation>
    </message>
    <message>
        <source>Experiment</source>
        <translation>Experiment</translation>
    </message>
    <message>
        <source>Experiment, a .toml file.</source>
        <translation>Experiment, eine .toml-Datei.</translation>
    </message>
    <message>
        <source>Explain the best places</source>
        <translation>Die besten Orte erklären</translation>
    </message>
    <message>
        <source>Explore a city</source>
        <translation>Stadt erkunden</translation>
    </message>
    <message>
        <source>Export cells, objects and queries for QGIS and other programs.</source>
        <translation>Exportiert Zellen, Objekte und Anfragen für QGIS und andere Programme.</translation>
    </message>
    <message>
        <source>Export to other programs</source>
        <translation>Für andere Programme exportieren</translation>
    </message>
    <message>
        <source>Field of view</source>
        <translation>Blickfeld</translation>
    </message>
    <message>
        <source>Field of view of a photo, around --look.</source>
        <translation>Blickfeld eines Fotos, um --look herum.</translation>
    </message>
    <message>
        <source>Field of view of a query, in any direction.</source>
        <translation>Blickfeld einer Anfrage, in beliebiger Richtung.</translation>
    </message>
    <message>
        <source>File</source>
        <translation>Datei</translation>
    </message>
    <message>
        <source>File of many queries, as CSV or JSON lines, or - for JSON lines from standard input. Prints a line of JSON for each: an answer or an error.</source>
        <translation>Datei mit vielen Anfragen als CSV oder JSON-Zeilen, oder - für JSON-Zeilen von der Standardeingabe. Gibt für jede eine Zeile JSON aus: eine Antwort oder einen Fehler.</translation>
    </message>
    <message>
        <source>File of queries</source>
        <translation>Datei mit Anfragen</translation>
    </message>
    <message>
        <source>File to write</source>
        <translation>Datei, die geschrieben wird</translation>
    </message>
    <message>
        <source>File to write. Its suffix is the format: .csv, .fgb, .geojson, .gpkg, .parquet, .pmtiles, .tif or .json. A .gpkg (for QGIS) has all layers, .pmtiles (for web maps) the cells, .tif a raster of the cells, .json a description (STAC item), and other formats one layer.</source>
        <translation>Datei, die geschrieben wird. Ihre Endung ist das Format: .csv, .fgb, .geojson, .gpkg, .parquet, .pmtiles, .tif oder .json. Ein .gpkg (für QGIS) enthält alle Layer, .pmtiles (für Webkarten) die Zellen, .tif ein Raster der Zellen, .json eine Beschreibung (STAC-Eintrag), andere Formate einen Layer.</translation>
    </message>
    <message>
        <source>File to write: search regions and candidates for QGIS (.gpkg) or in degrees (.geojson, .kml), only the regions (.parquet, .fgb, .csv), or the chance of every cell (.tif).</source>
        <translation>Datei, die geschrieben wird: Gebiete und Kandidaten für QGIS (.gpkg) oder in Grad (.geojson, .kml), nur die Gebiete (.parquet, .fgb, .csv) oder die Wahrscheinlichkeit jeder Zelle (.tif).</translation>
    </message>
    <message>
        <source>Files</source>
        <translation>Dateien</translation>
    </message>
    <message>
        <source>Files, or a folder of files.</source>
        <translation>Dateien oder ein Ordner mit Dateien.</translation>
    </message>
    <message>
        <source>Filters of the catalogue</source>
        <translation>Filter des Katalogs</translation>
    </message>
    <message>
        <source>Find a class</source>
        <translation>Klasse suchen</translation>
    </message>
    <message>
        <source>Find the place</source>
        <translation>Ort suchen</translation>
    </message>
    <message>
        <source>Find where a view was seen from, or many views.</source>
        <translation>Findet, von wo eine Ansicht oder viele Ansichten stammen.</translation>
    </message>
    <message>
        <source>Find where the views of a route were seen from.</source>
        <translation>Findet, von wo die Ansichten eines Weges stammen.</translation>
    </message>
    <message>
        <source>First database</source>
        <translation>Erste Datenbank</translation>
    </message>
    <message>
        <source>First noise model</source>
        <translation>Erstes Fehlermodell</translation>
    </message>
    <message>
        <source>First noise model for --unlabelled, a name or a file.</source>
        <translation>Erstes Fehlermodell für --unlabelled, ein Name oder eine Datei.</translation>
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
        <source>Folder of an experiment or of an evaluation.</source>
        <translation>Ordner eines Experiments oder einer Auswertung.</translation>
    </message>
    <message>
        <source>Folder of results</source>
        <translation>Ordner mit Ergebnissen</translation>
    </message>
    <message>
        <source>Folder of the cache</source>
        <translation>Ordner des Zwischenspeichers</translation>
    </message>
    <message>
        <source>Folder of the cache.</source>
        <translation>Ordner des Zwischenspeichers.</translation>
    </message>
    <message>
        <source>Folder of the check</source>
        <translation>Ordner der Prüfung</translation>
    </message>
    <message>
        <source>Folder of the pictures</source>
        <translation>Ordner der Bilder</translation>
    </message>
    <message>
        <source>Folder of the pictures, to read focal length and heading from EXIF.</source>
        <translation>Ordner der Bilder, um Brennweite und Blickrichtung aus EXIF zu lesen.</translation>
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
        <source>Folder to write a report of the check to.</source>
        <translation>Der Ordner, in den ein Bericht der Prüfung geschrieben wird.</translation>
    </message>
    <message>
        <source>Folder to write the report and results to.</source>
        <translation>Der Ordner, in den Bericht und Ergebnisse geschrieben werden.</translation>
    </message>
    <message>
        <source>Folder to write the results to.</source>
        <translation>Der Ordner, in den die Ergebnisse geschrieben werden.</translation>
    </message>
    <message>
        <source>Folder to write to.</source>
        <translation>Der Ordner, in den geschrieben wird.</translation>
    </message>
    <message>
        <source>Folder with the files of the data set.</source>
        <translation>Ordner mit den Dateien des Datensatzes.</translation>
    </message>
    <message>
        <source>Folder written by `semsig evaluate --out`, to add its queries.</source>
        <translation>Ordner, den `semsig evaluate --out` geschrieben hat; seine Anfragen kommen hinzu.</translation>
    </message>
    <message>
        <source>Folder written by `semsig evaluate --out`.</source>
        <translation>Ordner, den `semsig evaluate --out` geschrieben hat.</translation>
    </message>
    <message>
        <source>Footprints to draw below the map.</source>
        <translation>Grundrisse, die unter die Karte gezeichnet werden.</translation>
    </message>
    <message>
        <source>Found: the place is within {metres} m with a chance of {chance}.</source>
        <translation>Gefunden: Der Ort liegt mit einer Wahrscheinlichkeit von {chance} im Umkreis von {metres} m.</translation>
    </message>
    <message>
        <source>From the centres of cells</source>
        <translation>Aus der Mitte von Zellen</translation>
    </message>
    <message>
        <source>From the true to the best place</source>
        <translation>Vom wahren zum besten Ort</translation>
    </message>
    <message>
        <source>GPX track</source>
        <translation>GPX-Track</translation>
    </message>
    <message>
        <source>GPX track of the route, matched by the time of each view, or with one point for each view.</source>
        <translation>GPX-Track des Weges, nach der Zeit jeder Ansicht zugeordnet oder mit einem Punkt für jede Ansicht.</translation>
    </message>
    <message>
        <source>GeoPackage</source>
        <translation>GeoPackage</translation>
    </message>
    <message>
        <source>GeoPackage written by `semsig export`.</source>
        <translation>GeoPackage, das `semsig export` geschrieben hat.</translation>
    </message>
    <message>
        <source>Give up a download after this time, all attempts together.</source>
        <translation>Einen Download nach dieser Zeit aufgeben, alle Versuche zusammen.</translation>
    </message>
    <message>
        <source>Grey</source>
        <translation>Grau</translation>
    </message>
    <message>
        <source>Heading</source>
        <translation>Blickrichtung</translation>
    </message>
    <message>
        <source>Help</source>
        <translation>Hilfe</translation>
    </message>
    <message>
        <source>Hexagons</source>
        <translation>Sechsecke</translation>
    </message>
    <message>
        <source>Horizontal field of view.</source>
        <translation>Horizontales Blickfeld.</translation>
    </message>
    <message>
        <source>How a cell is drawn.</source>
        <translation>Wie eine Zelle gezeichnet wird: als Polygon (polygon) oder Punkt (point).</translation>
    </message>
    <message>
        <source>How the class of a false object is drawn.</source>
        <translation>Wie die Klasse eines falschen Objekts gezogen wird.</translation>
    </message>
    <message>
        <source>Identifiability</source>
        <translation>Erkennbarkeit</translation>
    </message>
    <message>
        <source>Import from QGIS</source>
        <translation>Aus QGIS importieren</translation>
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
        <source>Keep only what is in this box in degrees, in the polygons of a file, or with 'box' in the box that OpenStreetMap files state; with 'none' keep all.</source>
        <translation>Nur behalten, was in diesem Rechteck in Grad, in den Polygonen einer Datei oder mit 'box' in dem Rechteck liegt, das Dateien von OpenStreetMap angeben; mit 'none' alles behalten.</translation>
    </message>
    <message>
        <source>Keep the cells in this box in degrees, or in polygons.</source>
        <translation>Nur die Zellen in diesem Rechteck in Grad oder in Polygonen behalten.</translation>
    </message>
    <message>
        <source>Keep the order of the objects</source>
        <translation>Reihenfolge der Objekte behalten</translation>
    </message>
    <message>
        <source>Largest distortion allowed for the CRS: degrees of bearings, percent of lengths.</source>
        <translation>Größte zulässige Verzerrung des KBS: Grad bei Richtungen, Prozent bei Längen.</translation>
    </message>
    <message>
        <source>Largest distortion of the CRS</source>
        <translation>Größte Verzerrung des KBS</translation>
    </message>
    <message>
        <source>Largest error</source>
        <translation>Größter Fehler</translation>
    </message>
    <message>
        <source>Largest error that counts as found.</source>
        <translation>Größter Fehler, der als gefunden gilt.</translation>
    </message>
    <message>
        <source>Last known place</source>
        <translation>Letzter bekannter Ort</translation>
    </message>
    <message>
        <source>Last known place, in degrees or as X,Y,SIGMA in the CRS of the database, SIGMA in metres.</source>
        <translation>Letzter bekannter Ort, in Grad oder als X,Y,SIGMA im KBS der Datenbank, SIGMA in Metern.</translation>
    </message>
    <message>
        <source>Layer to write, by default cells, in a .gpkg all: buildings, cells, evaluation, evaluation_lines, hexagons, objects, streets (repeat for several). In a .tif, by default ambiguity: ambiguity, error, field, identifiability.</source>
        <translation>Layer, der geschrieben wird, ohne Angabe cells, in einem .gpkg alle: buildings, cells, evaluation, evaluation_lines, hexagons, objects, streets (mehrere sind möglich). In einem .tif, ohne Angabe ambiguity: ambiguity, error, field, identifiability.</translation>
    </message>
    <message>
        <source>Layers</source>
        <translation>Layer</translation>
    </message>
    <message>
        <source>Learn detector errors</source>
        <translation>Fehler eines Detektors lernen</translation>
    </message>
    <message>
        <source>Learn the errors of a detector from detections of known places, or only from its views.</source>
        <translation>Lernt die Fehler eines Detektors aus Detektionen bekannter Orte oder nur aus seinen Ansichten.</translation>
    </message>
    <message>
        <source>Leave out boxes with a lower score.</source>
        <translation>Rahmen mit einem kleineren Konfidenzwert weglassen.</translation>
    </message>
    <message>
        <source>Letters of classes</source>
        <translation>Buchstaben der Klassen</translation>
    </message>
    <message>
        <source>List the catalogues, or the layers of one.</source>
        <translation>Führt die Kataloge auf oder die Layer eines Katalogs.</translation>
    </message>
    <message>
        <source>List what would be removed, but remove nothing.</source>
        <translation>Aufführen, was entfernt würde, aber nichts entfernen.</translation>
    </message>
    <message>
        <source>Load street objects</source>
        <translation>Straßenobjekte laden</translation>
    </message>
    <message>
        <source>Localize</source>
        <translation>Verorten</translation>
    </message>
    <message>
        <source>Localize a route</source>
        <translation>Weg verorten</translation>
    </message>
    <message>
        <source>Look</source>
        <translation>Ansehen</translation>
    </message>
    <message>
        <source>Look only at places in this box in degrees, or in polygons.</source>
        <translation>Nur Stellen in diesem Rechteck in Grad oder in Polygonen betrachten.</translation>
    </message>
    <message>
        <source>Looking for Python...</source>
        <translation>Python wird gesucht ...</translation>
    </message>
    <message>
        <source>Lowest score</source>
        <translation>Kleinster Konfidenzwert</translation>
    </message>
    <message>
        <source>Make up a city</source>
        <translation>Stadt erfinden</translation>
    </message>
    <message>
        <source>Make up a city: street objects, buildings and streets.</source>
        <translation>Erfindet eine Stadt: Straßenobjekte, Gebäude und Straßen.</translation>
    </message>
    <message>
        <source>Map from labels to classes, by name or .toml file; repeat for several, best first. With --detector also the names of its classes: coco, or a .txt, .yaml or .json file (default: from the model).</source>
        <translation>Zuordnung von Bezeichnungen zu Klassen, nach Namen oder als .toml-Datei; mehrere sind möglich, die beste zuerst. Mit --detector auch die Namen seiner Klassen: coco oder eine .txt-, .yaml- oder .json-Datei (ohne Angabe: aus dem Modell).</translation>
    </message>
    <message>
        <source>Map page</source>
        <translation>Kartenseite</translation>
    </message>
    <message>
        <source>Map to write (.html).</source>
        <translation>Karte, die geschrieben wird (.html).</translation>
    </message>
    <message>
        <source>Maps of labels</source>
        <translation>Zuordnungen der Bezeichnungen</translation>
    </message>
    <message>
        <source>Margin of the regions</source>
        <translation>Rand der Gebiete</translation>
    </message>
    <message>
        <source>Measure</source>
        <translation>Messen</translation>
    </message>
    <message>
        <source>Measure how often, and how closely, queries from known places are located.</source>
        <translation>Misst, wie oft und wie genau Anfragen von bekannten Orten verortet werden.</translation>
    </message>
    <message>
        <source>Measure methods on real photographs with known places.</source>
        <translation>Misst Verfahren an echten Fotos mit bekannten Orten.</translation>
    </message>
    <message>
        <source>Merge objects of different layers within the catalogue's radii.</source>
        <translation>Objekte verschiedener Layer innerhalb der Radien des Katalogs zusammenlegen.</translation>
    </message>
    <message>
        <source>Merge objects of layers</source>
        <translation>Objekte der Layer zusammenlegen</translation>
    </message>
    <message>
        <source>Merge signature databases</source>
        <translation>Signaturdatenbanken zusammenlegen</translation>
    </message>
    <message>
        <source>Merge the databases of two places into one.</source>
        <translation>Legt die Datenbanken zweier Orte zu einer zusammen.</translation>
    </message>
    <message>
        <source>Merged database</source>
        <translation>Zusammengelegte Datenbank</translation>
    </message>
    <message>
        <source>Method</source>
        <translation>Methode</translation>
    </message>
    <message>
        <source>Method of the paper</source>
        <translation>Verfahren des Aufsatzes</translation>
    </message>
    <message>
        <source>Methods</source>
        <translation>Verfahren</translation>
    </message>
    <message>
        <source>Methods with commas between them; --out has the worst failures of the last one.</source>
        <translation>Verfahren, durch Kommas getrennt; --out enthält die schlimmsten Fehlschläge des letzten.</translation>
    </message>
    <message>
        <source>Missed and false objects that the age of the map explains do not count.</source>
        <translation>Übersehene und falsche Objekte, die das Alter der Karte erklärt, zählen nicht.</translation>
    </message>
    <message>
        <source>More databases</source>
        <translation>Weitere Datenbanken</translation>
    </message>
    <message>
        <source>More databases before what was seen: the view may be from any of these cities.</source>
        <translation>Weitere Datenbanken vor dem, was zu sehen war: die Ansicht kann aus jeder dieser Städte stammen.</translation>
    </message>
    <message>
        <source>Most views</source>
        <translation>Meiste Ansichten</translation>
    </message>
    <message>
        <source>New street objects</source>
        <translation>Neue Straßenobjekte</translation>
    </message>
    <message>
        <source>New street objects; their layers replace layers of the database.</source>
        <translation>Neue Straßenobjekte; ihre Layer ersetzen Layer der Datenbank.</translation>
    </message>
    <message>
        <source>Noise model</source>
        <translation>Fehlermodell</translation>
    </message>
    <message>
        <source>Noise model of the method learned, written by `semsig learn`.</source>
        <translation>Fehlermodell des Verfahrens learned, von `semsig learn` geschrieben.</translation>
    </message>
    <message>
        <source>Noise model to write (.toml or .json), for --noise.</source>
        <translation>Fehlermodell, das geschrieben wird (.toml oder .json), für --noise.</translation>
    </message>
    <message>
        <source>North from which bearings are measured; grid north is that of the database.</source>
        <translation>Norden, von dem aus Richtungen gemessen werden; Gitternord ist der der Datenbank.</translation>
    </message>
    <message>
        <source>North is</source>
        <translation>Norden ist</translation>
    </message>
    <message>
        <source>North is unknown</source>
        <translation>Norden unbekannt</translation>
    </message>
    <message>
        <source>North of the bearings</source>
        <translation>Norden der Richtungen</translation>
    </message>
    <message>
        <source>Number of candidates</source>
        <translation>Anzahl der Kandidaten</translation>
    </message>
    <message>
        <source>Number of candidates.</source>
        <translation>Anzahl der Kandidaten.</translation>
    </message>
    <message>
        <source>Number of equal sectors in which the methods of the paper compare bearings.</source>
        <translation>Anzahl gleicher Sektoren, in denen die Verfahren des Aufsatzes Richtungen vergleichen.</translation>
    </message>
    <message>
        <source>Number of new queries to check the predictions with.</source>
        <translation>Anzahl neuer Anfragen, mit denen die Vorhersagen geprüft werden.</translation>
    </message>
    <message>
        <source>Number of processes on this machine.</source>
        <translation>Anzahl der Prozesse auf diesem Rechner.</translation>
    </message>
    <message>
        <source>Number of processes, 0 to use this one only.</source>
        <translation>Anzahl der Prozesse, 0 für nur diesen einen.</translation>
    </message>
    <message>
        <source>Number of queries</source>
        <translation>Anzahl der Anfragen</translation>
    </message>
    <message>
        <source>Number of queries to ask.</source>
        <translation>Anzahl der Anfragen, die gestellt werden.</translation>
    </message>
    <message>
        <source>Number of queries.</source>
        <translation>Anzahl der Anfragen.</translation>
    </message>
    <message>
        <source>Number of threads.</source>
        <translation>Anzahl der Threads.</translation>
    </message>
    <message>
        <source>Object detector</source>
        <translation>Objektdetektor</translation>
    </message>
    <message>
        <source>Object detector (.onnx) to run on photographs: YOLO, RT-DETR, DETR or torchvision. (needs the extra detect)</source>
        <translation>Objektdetektor (.onnx), der auf Fotos angewandt wird: YOLO, RT-DETR, DETR oder torchvision. (braucht das Extra detect)</translation>
    </message>
    <message>
        <source>Objects in both are kept once, and cells near both are computed again.</source>
        <translation>Objekte in beiden bleiben nur einmal, und Zellen nahe bei beiden werden neu berechnet.</translation>
    </message>
    <message>
        <source>Objects of the query</source>
        <translation>Objekte der Anfrage</translation>
    </message>
    <message>
        <source>Older versions and interrupted runs leave them; the database is not changed.</source>
        <translation>Ältere Versionen und abgebrochene Läufe hinterlassen sie; die Datenbank wird nicht geändert.</translation>
    </message>
    <message>
        <source>Online tiles</source>
        <translation>Online-Kacheln</translation>
    </message>
    <message>
        <source>Only list the files</source>
        <translation>Dateien nur aufführen</translation>
    </message>
    <message>
        <source>Only the classes of the paper</source>
        <translation>Nur die Klassen des Aufsatzes</translation>
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
        <source>Origin</source>
        <translation>Ursprung</translation>
    </message>
    <message>
        <source>Overpass server (leave empty for the usual ones)</source>
        <translation>Overpass-Server (leer lassen für die üblichen)</translation>
    </message>
    <message>
        <source>Pictures of one place</source>
        <translation>Bilder eines Ortes</translation>
    </message>
    <message>
        <source>Pictures to join into one view: none (each), pictures with GPS positions within 5 m (gps), or all; a place in --photos takes precedence.</source>
        <translation>Bilder, die zu einer Ansicht verbunden werden: keine (each), Bilder mit GPS-Positionen im Umkreis von 5 m (gps) oder alle (all); ein Ort in --photos hat Vorrang.</translation>
    </message>
    <message>
        <source>Pitch</source>
        <translation>Neigung</translation>
    </message>
    <message>
        <source>Place</source>
        <translation>Ort</translation>
    </message>
    <message>
        <source>Popularity of places</source>
        <translation>Beliebtheit von Orten</translation>
    </message>
    <message>
        <source>Precision</source>
        <translation>Genauigkeit</translation>
    </message>
    <message>
        <source>Predict how well queries from each cell will be located.</source>
        <translation>Sagt voraus, wie gut Anfragen aus jeder Zelle verortet werden.</translation>
    </message>
    <message>
        <source>Predict the accuracy</source>
        <translation>Genauigkeit vorhersagen</translation>
    </message>
    <message>
        <source>Prepare</source>
        <translation>Vorbereiten</translation>
    </message>
    <message>
        <source>Print the letters of classes, such as DDBL for what a cell sees.</source>
        <translation>Die Buchstaben der Klassen ausgeben, etwa DDBL für das, was eine Zelle sieht.</translation>
    </message>
    <message>
        <source>Print the properties of a database next to those in the paper.</source>
        <translation>Zeigt die Eigenschaften einer Datenbank neben denen im Aufsatz.</translation>
    </message>
    <message>
        <source>Processes</source>
        <translation>Prozesse</translation>
    </message>
    <message>
        <source>Projection</source>
        <translation>Projektion</translation>
    </message>
    <message>
        <source>Projection of the pictures.</source>
        <translation>Projektion der Bilder.</translation>
    </message>
    <message>
        <source>Properties of a database</source>
        <translation>Eigenschaften einer Datenbank</translation>
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
        <source>Queries to check the predictions</source>
        <translation>Anfragen zur Prüfung der Vorhersagen</translation>
    </message>
    <message>
        <source>Radius of smoothing</source>
        <translation>Radius der Glättung</translation>
    </message>
    <message>
        <source>Radius over which an evaluation is smoothed.</source>
        <translation>Radius, über den eine Auswertung geglättet wird.</translation>
    </message>
    <message>
        <source>Rank</source>
        <translation>Rang</translation>
    </message>
    <message>
        <source>Rank as the paper does: --method edit+edit:5%.</source>
        <translation>Ordnen wie der Aufsatz: --method edit+edit:5%.</translation>
    </message>
    <message>
        <source>Rank by likelihood, or by distance as TYPES+ANGLES (edit, histogram, jaccard), types:edit or angles:edit; add :5% for two stages, :alpha=0.7, :raw or :weights=INSERT/DELETE/SUBSTITUTE.</source>
        <translation>Nach Wahrscheinlichkeit ordnen (likelihood) oder nach Distanz als TYPES+ANGLES (edit, histogram, jaccard), types:edit oder angles:edit; dazu :5% für zwei Stufen, :alpha=0.7, :raw oder :weights=INSERT/DELETE/SUBSTITUTE.</translation>
    </message>
    <message>
        <source>Raster of how likely each place is beforehand, such as population.</source>
        <translation>Raster, das sagt, wie wahrscheinlich jeder Ort im Voraus ist, etwa die Bevölkerung.</translation>
    </message>
    <message>
        <source>Raster to write (.tif).</source>
        <translation>Raster, das geschrieben wird (.tif).</translation>
    </message>
    <message>
        <source>Rate at which the city changes, for --map-age: output of `semsig update --years N --json`, or a .toml file with the same keys.</source>
        <translation>Rate, mit der sich die Stadt ändert, für --map-age: Ausgabe von `semsig update --years N --json` oder eine .toml-Datei mit denselben Schlüsseln.</translation>
    </message>
    <message>
        <source>Rate of change</source>
        <translation>Änderungsrate</translation>
    </message>
    <message>
        <source>Read files of open data into street objects.</source>
        <translation>Liest Dateien offener Daten in Straßenobjekte ein.</translation>
    </message>
    <message>
        <source>Read only the eleven classes of the paper.</source>
        <translation>Nur die elf Klassen des Aufsatzes lesen.</translation>
    </message>
    <message>
        <source>Read only this layer, or with +NAME also this one; may be repeated.</source>
        <translation>Nur diesen Layer lesen oder mit +NAME auch diesen; mehrere sind möglich.</translation>
    </message>
    <message>
        <source>Read the optional layers of objects as well.</source>
        <translation>Auch die optionalen Layer mit Objekten lesen.</translation>
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
        <source>Remove leftover files</source>
        <translation>Übrige Dateien entfernen</translation>
    </message>
    <message>
        <source>Remove leftover files next to a database.</source>
        <translation>Entfernt übrig gebliebene Dateien neben einer Datenbank.</translation>
    </message>
    <message>
        <source>Repeat the paper's experiments</source>
        <translation>Experimente des Aufsatzes wiederholen</translation>
    </message>
    <message>
        <source>Repeat the paper's experiments and compare the results.</source>
        <translation>Wiederholt die Experimente des Aufsatzes und vergleicht die Ergebnisse.</translation>
    </message>
    <message>
        <source>Report page</source>
        <translation>Berichtsseite</translation>
    </message>
    <message>
        <source>Research</source>
        <translation>Forschen</translation>
    </message>
    <message>
        <source>Resolution of hexagons</source>
        <translation>Auflösung der Sechsecke</translation>
    </message>
    <message>
        <source>Restore a database from an exported GeoPackage.</source>
        <translation>Stellt eine Datenbank aus einem exportierten GeoPackage wieder her.</translation>
    </message>
    <message>
        <source>Results</source>
        <translation>Ergebnisse</translation>
    </message>
    <message>
        <source>Results to write (.json).</source>
        <translation>Ergebnisse, die geschrieben werden (.json).</translation>
    </message>
    <message>
        <source>Roll</source>
        <translation>Rollwinkel</translation>
    </message>
    <message>
        <source>Rough distances</source>
        <translation>Ungefähre Entfernungen</translation>
    </message>
    <message>
        <source>Rough distances: metres, near, middle, far or ?, such as 12,?,near.</source>
        <translation>Ungefähre Entfernungen: Meter, near (nah), middle (mittel), far (fern) oder ?, etwa 12,?,near.</translation>
    </message>
    <message>
        <source>Rule for answers</source>
        <translation>Regel für Antworten</translation>
    </message>
    <message>
        <source>Rule for when to answer, written by `semsig calibrate`.</source>
        <translation>Regel, wann geantwortet wird, von `semsig calibrate` geschrieben.</translation>
    </message>
    <message>
        <source>Rule to write (.json), for --rule.</source>
        <translation>Regel, die geschrieben wird (.json), für --rule.</translation>
    </message>
    <message>
        <source>Run an experiment</source>
        <translation>Experiment ausführen</translation>
    </message>
    <message>
        <source>Run every step on a small made-up town, offline.</source>
        <translation>Führt jeden Schritt mit einem kleinen erfundenen Ort aus, ohne Netz.</translation>
    </message>
    <message>
        <source>Run the evaluations of an experiment, or resume them.</source>
        <translation>Führt die Auswertungen eines Experiments aus oder setzt sie fort.</translation>
    </message>
    <message>
        <source>Run the paper's 10,000 queries, or 300 in a small city.</source>
        <translation>Die 10.000 Anfragen des Aufsatzes ausführen oder 300 in einer kleinen Stadt.</translation>
    </message>
    <message>
        <source>Say what the data of a place can carry, before you build.</source>
        <translation>Sagt vor dem Aufbau, was die Daten eines Ortes hergeben.</translation>
    </message>
    <message>
        <source>Scheduler</source>
        <translation>Scheduler</translation>
    </message>
    <message>
        <source>Search between the centres of cells</source>
        <translation>Zwischen den Mitten der Zellen suchen</translation>
    </message>
    <message>
        <source>Search only cells that see this: M (one or more), 2B (two or more), B=0 (none), ?&lt;=10 (at most ten objects).</source>
        <translation>Nur Zellen durchsuchen, die das sehen: M (mindestens eins), 2B (mindestens zwei), B=0 (keins), ?&lt;=10 (höchstens zehn Objekte).</translation>
    </message>
    <message>
        <source>Search only in this box in degrees, or in the polygons of a file.</source>
        <translation>Nur in diesem Rechteck in Grad oder in den Polygonen einer Datei suchen.</translation>
    </message>
    <message>
        <source>Second database</source>
        <translation>Zweite Datenbank</translation>
    </message>
    <message>
        <source>Sectors</source>
        <translation>Sektoren</translation>
    </message>
    <message>
        <source>Sectors that were looked at, if not the full turn, such as 20-90,180-250.</source>
        <translation>Sektoren, in die geblickt wurde, wenn nicht ringsum, etwa 20-90,180-250.</translation>
    </message>
    <message>
        <source>Seed</source>
        <translation>Startwert</translation>
    </message>
    <message>
        <source>Seed of the random numbers.</source>
        <translation>Startwert der Zufallszahlen.</translation>
    </message>
    <message>
        <source>Seed of the town and the queries.</source>
        <translation>Startwert des Ortes und der Anfragen.</translation>
    </message>
    <message>
        <source>Seen from here</source>
        <translation>Von hier gesehen</translation>
    </message>
    <message>
        <source>Seen from here: {seen}. {count} other cells see the same in this order.</source>
        <translation>Von hier zu sehen: {seen}. {count} weitere Zellen sehen das Gleiche in dieser Reihenfolge.</translation>
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
        <source>Server</source>
        <translation>Server</translation>
    </message>
    <message>
        <source>Shape of a cell</source>
        <translation>Form einer Zelle</translation>
    </message>
    <message>
        <source>Share of the answers that should be right.</source>
        <translation>Anteil der Antworten, die stimmen sollen.</translation>
    </message>
    <message>
        <source>Show how many cells see the same types in the same order.</source>
        <translation>Zeigt, wie viele Zellen dieselben Typen in derselben Reihenfolge sehen.</translation>
    </message>
    <message>
        <source>Show which objects of the view match which street objects, which were missed and which look false.</source>
        <translation>Zeigen, welche Objekte der Ansicht zu welchen Straßenobjekten passen, welche übersehen wurden und welche falsch aussehen.</translation>
    </message>
    <message>
        <source>Shows what is seen from a cell, and the most similar cells.</source>
        <translation>Zeigt, was man aus einer Zelle sieht, und die ähnlichsten Zellen.</translation>
    </message>
    <message>
        <source>Side of a cell</source>
        <translation>Seite einer Zelle</translation>
    </message>
    <message>
        <source>Side of a cell.</source>
        <translation>Seite einer Zelle.</translation>
    </message>
    <message>
        <source>Side of the city</source>
        <translation>Seite der Stadt</translation>
    </message>
    <message>
        <source>Side of the square city.</source>
        <translation>Seite der quadratischen Stadt.</translation>
    </message>
    <message>
        <source>Signature cells</source>
        <translation>Signaturzellen</translation>
    </message>
    <message>
        <source>Signature database</source>
        <translation>Signaturdatenbank</translation>
    </message>
    <message>
        <source>Signature database in one file or in tiles.</source>
        <translation>Signaturdatenbank in einer Datei oder in Kacheln.</translation>
    </message>
    <message>
        <source>Signature database to localize in; labels are mapped to its classes.</source>
        <translation>Signaturdatenbank, in der verortet wird; Bezeichnungen werden ihren Klassen zugeordnet.</translation>
    </message>
    <message>
        <source>Signature database to write (.parquet), or a folder with tiles.</source>
        <translation>Signaturdatenbank, die geschrieben wird (.parquet), oder ein Ordner mit Kacheln.</translation>
    </message>
    <message>
        <source>Signature database to write (.parquet).</source>
        <translation>Signaturdatenbank, die geschrieben wird (.parquet).</translation>
    </message>
    <message>
        <source>Signature database written by `semsig build`.</source>
        <translation>Signaturdatenbank, die `semsig build` geschrieben hat.</translation>
    </message>
    <message>
        <source>Signature databases (*.parquet)</source>
        <translation>Signaturdatenbanken (*.parquet)</translation>
    </message>
    <message>
        <source>Size of pictures where it is unknown, such as 1920x1080.</source>
        <translation>Größe der Bilder, wo sie unbekannt ist, etwa 1920x1080.</translation>
    </message>
    <message>
        <source>Size of the experiments</source>
        <translation>Umfang der Experimente</translation>
    </message>
    <message>
        <source>Size of the pictures</source>
        <translation>Größe der Bilder</translation>
    </message>
    <message>
        <source>Some square kilometres take seconds to minutes. What was downloaded before is taken from the cache. The server is a setting: Settings &gt; Options &gt; Processing &gt; Providers &gt; Semantic signatures.</source>
        <translation>Einige Quadratkilometer brauchen Sekunden bis Minuten. Was schon heruntergeladen wurde, kommt aus dem Zwischenspeicher. Der Server wird eingestellt unter Einstellungen &gt; Optionen &gt; Verarbeitung &gt; Anbieter &gt; Semantische Signaturen.</translation>
    </message>
    <message>
        <source>Squares of cells</source>
        <translation>Quadrate der Zellen</translation>
    </message>
    <message>
        <source>Standard deviation of the heading in degrees, or unknown.</source>
        <translation>Standardabweichung der Blickrichtung in Grad, oder unknown (unbekannt).</translation>
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
        <source>Street objects to add as a layer.</source>
        <translation>Straßenobjekte, die als Layer hinzukommen.</translation>
    </message>
    <message>
        <source>Street objects to write (.parquet).</source>
        <translation>Straßenobjekte, die geschrieben werden (.parquet).</translation>
    </message>
    <message>
        <source>Street objects to write, if exported.</source>
        <translation>Straßenobjekte, die geschrieben werden, wenn sie exportiert wurden.</translation>
    </message>
    <message>
        <source>Street objects written by `semsig load`.</source>
        <translation>Straßenobjekte, die `semsig load` geschrieben hat.</translation>
    </message>
    <message>
        <source>Street objects: a file written by `semsig load`, or an object store.</source>
        <translation>Straßenobjekte: eine Datei, die `semsig load` geschrieben hat, oder ein Objektspeicher.</translation>
    </message>
    <message>
        <source>Street width</source>
        <translation>Straßenbreite</translation>
    </message>
    <message>
        <source>Streets</source>
        <translation>Straßen</translation>
    </message>
    <message>
        <source>Suggest what to look for</source>
        <translation>Vorschlagen, wonach zu schauen ist</translation>
    </message>
    <message>
        <source>Suggest what to look for next, most useful first.</source>
        <translation>Schlägt vor, wonach als Nächstes zu schauen ist, das Nützlichste zuerst.</translation>
    </message>
    <message>
        <source>Surely from this area</source>
        <translation>Sicher aus diesem Gebiet</translation>
    </message>
    <message>
        <source>Survey a place's data</source>
        <translation>Daten eines Ortes sichten</translation>
    </message>
    <message>
        <source>Symbols clockwise from north, such as DDBL; ? where one is unknown.</source>
        <translation>Symbole von Norden an im Uhrzeigersinn, etwa DDBL; ? für ein unbekanntes.</translation>
    </message>
    <message>
        <source>The city is divided into square cells. For each it is stored which street objects are seen from its centre, clockwise from north: its signature. Cells that see nothing are left out. A folder with the street objects, ready to be searched, is written next to the database.</source>
        <translation>Die Stadt wird in quadratische Zellen geteilt. Für jede wird gespeichert, welche Straßenobjekte von ihrer Mitte aus zu sehen sind, von Norden an im Uhrzeigersinn: ihre Signatur. Zellen, die nichts sehen, fallen weg. Neben der Datenbank wird ein Ordner mit den Straßenobjekten geschrieben, bereit zum Suchen.</translation>
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
        <source>The layers, in a GeoPackage.</source>
        <translation>Die Layer, in einem GeoPackage.</translation>
    </message>
    <message>
        <source>The places that a view from here may be confused with, by chance:</source>
        <translation>Die Orte, mit denen eine Ansicht von hier verwechselt werden kann, nach Wahrscheinlichkeit:</translation>
    </message>
    <message>
        <source>The semsig command (leave empty to look for it)</source>
        <translation>Der Befehl semsig (leer lassen, um ihn zu suchen)</translation>
    </message>
    <message>
        <source>The tools need an engine: the program semsig in a Python environment of its own, in the folder of your QGIS profile. It takes about 1 GB; nothing else on this computer is changed.</source>
        <translation>Die Werkzeuge brauchen eine Engine: das Programm semsig in einer eigenen Python-Umgebung im Ordner Ihres QGIS-Profils. Sie belegt etwa 1 GB; sonst wird auf diesem Computer nichts geändert.</translation>
    </message>
    <message>
        <source>The view fits the best place badly: worse than {worse} of 1,000 simulated views from there.</source>
        <translation>Die Ansicht passt schlecht zum besten Ort: schlechter als {worse} von 1.000 simulierten Ansichten von dort.</translation>
    </message>
    <message>
        <source>The view may not be from this area: chance {chance}.</source>
        <translation>Die Ansicht stammt vielleicht nicht aus diesem Gebiet: Wahrscheinlichkeit {chance}.</translation>
    </message>
    <message>
        <source>The view may not be from this area: chance {chance}; it fits the best place worse than {worse} of 1,000 simulated views from there.</source>
        <translation>Die Ansicht stammt vielleicht nicht aus diesem Gebiet: Wahrscheinlichkeit {chance}; sie passt zum besten Ort schlechter als {worse} von 1.000 simulierten Ansichten von dort.</translation>
    </message>
    <message>
        <source>This is what is seen from there; change it, or find the place.</source>
        <translation>Das sieht man von dort; ändern Sie es oder suchen Sie den Ort.</translation>
    </message>
    <message>
        <source>Threads</source>
        <translation>Threads</translation>
    </message>
    <message>
        <source>Tile size</source>
        <translation>Kachelgröße</translation>
    </message>
    <message>
        <source>Tile size; 2000 with --workers or --scheduler.</source>
        <translation>Kachelgröße; 2000 mit --workers oder --scheduler.</translation>
    </message>
    <message>
        <source>Time between the objects</source>
        <translation>Zeit zwischen den Objekten</translation>
    </message>
    <message>
        <source>Time limit</source>
        <translation>Zeitlimit</translation>
    </message>
    <message>
        <source>Title</source>
        <translation>Titel</translation>
    </message>
    <message>
        <source>Total chance of the regions of --out.</source>
        <translation>Gesamte Wahrscheinlichkeit der Gebiete von --out.</translation>
    </message>
    <message>
        <source>Turn the boxes of an object detector into views for semsig localize.</source>
        <translation>Macht aus den Rahmen eines Objektdetektors Ansichten für semsig localize.</translation>
    </message>
    <message>
        <source>Types</source>
        <translation>Arten</translation>
    </message>
    <message>
        <source>Update signature database</source>
        <translation>Signaturdatenbank aktualisieren</translation>
    </message>
    <message>
        <source>Updated database</source>
        <translation>Aktualisierte Datenbank</translation>
    </message>
    <message>
        <source>Use at most this many views a set.</source>
        <translation>Höchstens so viele Ansichten je Teil verwenden.</translation>
    </message>
    <message>
        <source>Use the buildings and streets that `semsig load` wrote next to the street objects.</source>
        <translation>Die Gebäude und Straßen nutzen, die `semsig load` neben die Straßenobjekte geschrieben hat.</translation>
    </message>
    <message>
        <source>Use the cache only.</source>
        <translation>Nur den Zwischenspeicher verwenden.</translation>
    </message>
    <message>
        <source>Vector file, or folder of files, to draft for.</source>
        <translation>Vektordatei oder Ordner mit Dateien für den Entwurf.</translation>
    </message>
    <message>
        <source>Viewpoints</source>
        <translation>Standpunkte</translation>
    </message>
    <message>
        <source>Viewpoints: every cell, outdoor cells or cells near streets.</source>
        <translation>Standpunkte: alle Zellen (all), Zellen außerhalb der Gebäude (outdoor) oder Zellen an Straßen (streets).</translation>
    </message>
    <message>
        <source>Views</source>
        <translation>Ansichten</translation>
    </message>
    <message>
        <source>Views from detections</source>
        <translation>Ansichten aus Detektionen</translation>
    </message>
    <message>
        <source>Views in their order: a CSV or JSON lines file, or - for JSON lines from standard input. Each after the first has the step from the previous view, dx,dy or distance,bearing (metres, degrees), and its sigma; or use --track.</source>
        <translation>Ansichten in ihrer Reihenfolge: eine Datei mit CSV oder JSON-Zeilen, oder - für JSON-Zeilen von der Standardeingabe. Jede nach der ersten hat den Schritt von der vorigen Ansicht, dx,dy oder distance,bearing (Meter, Grad), und dessen sigma; oder nehmen Sie --track.</translation>
    </message>
    <message>
        <source>Views of one camera and detector at unknown places, instead of --samples: a CSV or JSON lines file, as of semsig localize --queries.</source>
        <translation>Ansichten einer Kamera und eines Detektors von unbekannten Orten, statt --samples: eine Datei mit CSV oder JSON-Zeilen wie bei semsig localize --queries.</translation>
    </message>
    <message>
        <source>Views of unknown places</source>
        <translation>Ansichten unbekannter Orte</translation>
    </message>
    <message>
        <source>Views to write (.jsonl), for --queries.</source>
        <translation>Ansichten, die geschrieben werden (.jsonl), für --queries.</translation>
    </message>
    <message>
        <source>Visibility range</source>
        <translation>Sichtweite</translation>
    </message>
    <message>
        <source>Visibility range for classes without a range in the catalogue.</source>
        <translation>Sichtweite für Klassen, für die der Katalog keine nennt.</translation>
    </message>
    <message>
        <source>Visibility range.</source>
        <translation>Sichtweite.</translation>
    </message>
    <message>
        <source>What was seen</source>
        <translation>Was zu sehen war</translation>
    </message>
    <message>
        <source>What was seen, such as 'bench at 40, two trees NE, no hydrant' or 'bench left, lamp behind near'; or letters of classes clockwise from north, such as DDBL.</source>
        <translation>Was zu sehen war, etwa 'Bank bei 40, zwei Bäume NO, kein Hydrant' oder 'Bank links, Laterne hinter mir nah'; oder Buchstaben von Klassen von Norden an im Uhrzeigersinn, etwa DDBL.</translation>
    </message>
    <message>
        <source>Whether north is known: known, unknown, or its standard deviation in degrees, 0.001 to 360.</source>
        <translation>Ob Norden bekannt ist: known (bekannt), unknown (unbekannt) oder die Standardabweichung in Grad, 0.001 bis 360.</translation>
    </message>
    <message>
        <source>Without a network</source>
        <translation>Ohne Netz</translation>
    </message>
    <message>
        <source>Write a page with curves, a map and the worst failures (.html).</source>
        <translation>Eine Seite mit Kurven, einer Karte und den schlimmsten Fehlschlägen schreiben (.html).</translation>
    </message>
    <message>
        <source>Write a title on the map, such as the city and the date of its data.</source>
        <translation>Einen Titel auf die Karte schreiben, etwa die Stadt und das Datum ihrer Daten.</translation>
    </message>
    <message>
        <source>Write hexagons of this resolution of H3, such as 9, that sum up cells, objects and queries.</source>
        <translation>Sechsecke dieser Auflösung von H3 schreiben, etwa 9, die Zellen, Objekte und Anfragen zusammenfassen.</translation>
    </message>
    <message>
        <source>Write the buildings and streets of the source as well, next to --out.</source>
        <translation>Auch die Gebäude und Straßen der Quelle schreiben, neben --out.</translation>
    </message>
    <message>
        <source>Years between the old objects and the new ones, for the report of --json.</source>
        <translation>Jahre zwischen den alten und den neuen Objekten, für den Bericht von --json.</translation>
    </message>
    <message>
        <source>a made-up Paris</source>
        <translation>ein erfundenes Paris</translation>
    </message>
    <message>
        <source>all built-in maps</source>
        <translation>alle eingebauten</translation>
    </message>
    <message>
        <source>all processors</source>
        <translation>alle Prozessoren</translation>
    </message>
    <message>
        <source>all processors, 0 for --size small</source>
        <translation>alle Prozessoren, 0 bei --size small</translation>
    </message>
    <message>
        <source>as a polygon, in CSV as a point</source>
        <translation>als Polygon, in CSV als Punkt</translation>
    </message>
    <message>
        <source>as many cells as Paris</source>
        <translation>so viele Zellen wie Paris</translation>
    </message>
    <message>
        <source>box where a file states one</source>
        <translation>box, wo eine Datei eines angibt</translation>
    </message>
    <message>
        <source>by-hand for a view in words, photo for a view of sectors, panorama for a full turn with scores, otherwise generic</source>
        <translation>by-hand für eine Ansicht in Worten, photo für eine Ansicht aus Sektoren, panorama für ringsum mit Konfidenzwerten, sonst generic</translation>
    </message>
    <message>
        <source>downloaded</source>
        <translation>wird heruntergeladen</translation>
    </message>
    <message>
        <source>extent</source>
        <translation>Ausdehnung</translation>
    </message>
    <message>
        <source>file</source>
        <translation>Datei</translation>
    </message>
    <message>
        <source>from EXIF</source>
        <translation>aus EXIF</translation>
    </message>
    <message>
        <source>from EXIF; 360 for a panorama</source>
        <translation>aus EXIF; 360 bei einem Panorama</translation>
    </message>
    <message>
        <source>from a chance of 0.9</source>
        <translation>ab einer Wahrscheinlichkeit von 0,9</translation>
    </message>
    <message>
        <source>from the database</source>
        <translation>aus der Datenbank</translation>
    </message>
    <message>
        <source>full turn</source>
        <translation>ringsum</translation>
    </message>
    <message>
        <source>in place</source>
        <translation>an Ort und Stelle</translation>
    </message>
    <message>
        <source>learn it</source>
        <translation>wird gelernt</translation>
    </message>
    <message>
        <source>likelihood</source>
        <translation>likelihood</translation>
    </message>
    <message>
        <source>looked for</source>
        <translation>wird gesucht</translation>
    </message>
    <message>
        <source>m</source>
        <translation>m</translation>
    </message>
    <message>
        <source>name</source>
        <translation>Name</translation>
    </message>
    <message>
        <source>next to the street objects, if there are any</source>
        <translation>neben den Straßenobjekten, falls es welche gibt</translation>
    </message>
    <message>
        <source>outdoor where there are buildings, otherwise all</source>
        <translation>outdoor, wo es Gebäude gibt, sonst all</translation>
    </message>
    <message>
        <source>over 99 %</source>
        <translation>über 99 %</translation>
    </message>
    <message>
        <source>pinhole</source>
        <translation>pinhole (Lochkamera)</translation>
    </message>
    <message>
        <source>polygons</source>
        <translation>Polygone</translation>
    </message>
    <message>
        <source>s</source>
        <translation>s</translation>
    </message>
    <message>
        <source>semsig's own</source>
        <translation>der von semsig</translation>
    </message>
    <message>
        <source>that of --size</source>
        <translation>die von --size</translation>
    </message>
    <message>
        <source>that of Monaco in OpenStreetMap</source>
        <translation>die von Monaco in OpenStreetMap</translation>
    </message>
    <message>
        <source>the catalogue's or the UTM zone</source>
        <translation>das des Katalogs oder die UTM-Zone</translation>
    </message>
    <message>
        <source>the classes of all built-in catalogues</source>
        <translation>die Klassen aller eingebauten Kataloge</translation>
    </message>
    <message>
        <source>the folder of the files, or the one of images next to it</source>
        <translation>der Ordner der Dateien oder der Ordner images daneben</translation>
    </message>
    <message>
        <source>the name of --out with .buildings</source>
        <translation>der Name von --out mit .buildings</translation>
    </message>
    <message>
        <source>the name of --out with .streets</source>
        <translation>der Name von --out mit .streets</translation>
    </message>
    <message>
        <source>the name of the database's file</source>
        <translation>der Name der Datei der Datenbank</translation>
    </message>
    <message>
        <source>the store of the database</source>
        <translation>der Speicher der Datenbank</translation>
    </message>
    <message>
        <source>today</source>
        <translation>heute</translation>
    </message>
    <message>
        <source>under 1 %</source>
        <translation>unter 1 %</translation>
    </message>
    <message>
        <source>uniform</source>
        <translation>uniform (gleichmäßig)</translation>
    </message>
    <message>
        <source>where there are street objects and bearings</source>
        <translation>wo es Straßenobjekte und Richtungen gibt</translation>
    </message>
    <message>
        <source>years</source>
        <translation>Jahre</translation>
    </message>
    <message>
        <source>{name}: {cells} cells. Click a cell, or compose what you see.</source>
        <translation>{name}: {cells} Zellen. Klicken Sie eine Zelle an oder stellen Sie zusammen, was Sie sehen.</translation>
    </message>
    <message>
        <source>{title}: {part}</source>
        <translation>{title}: {part}</translation>
    </message>
    <message>
        <source>°</source>
        <translation>°</translation>
    </message>
    <message>
        <source>“{}”</source>
        <translation>„{}“</translation>
    </message>
</context>
</TS>
