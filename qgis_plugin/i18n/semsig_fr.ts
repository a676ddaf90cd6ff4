<?xml version="1.0" encoding="utf-8"?>
<!DOCTYPE TS>
<TS version="2.1" language="fr" sourcelanguage="en">
<context>
    <name>Semsig</name>
    <message>
        <source>0.9</source>
        <translation>0,9</translation>
    </message>
    <message>
        <source>10 from EXIF; otherwise left to semsig localize</source>
        <translation>10 avec EXIF ; sinon laissé à semsig localize</translation>
    </message>
    <message>
        <source>250, or more where queries are few</source>
        <translation>250, ou plus là où les requêtes sont rares</translation>
    </message>
    <message>
        <source>A cell must see</source>
        <translation>Une cellule doit voir</translation>
    </message>
    <message>
        <source>A unique cell can be identified at once, one of a thousand cannot. The raster holds, for each cell, the number of cells that look the same. `semsig identify` gives more detail, and takes longer.</source>
        <translation>Une cellule unique se reconnaît aussitôt, une parmi mille non. Le raster contient, pour chaque cellule, le nombre de cellules qui se ressemblent. `semsig identify` en dit plus, et prend plus de temps.</translation>
    </message>
    <message>
        <source>Adapt the errors to the queries</source>
        <translation>Adapter les erreurs aux requêtes</translation>
    </message>
    <message>
        <source>Adapt the noise to all --queries first, which are views of one camera and detector.</source>
        <translation>Adapter d’abord le modèle d’erreurs à toutes les --queries, qui sont des vues d’une caméra et d’un détecteur.</translation>
    </message>
    <message>
        <source>Address of a Dask scheduler.</source>
        <translation>Adresse d’un ordonnanceur Dask.</translation>
    </message>
    <message>
        <source>Address of a server to use instead of the catalogue's.</source>
        <translation>Adresse d’un serveur à utiliser au lieu de celui du catalogue.</translation>
    </message>
    <message>
        <source>Adds columns to the database, which `semsig info`, `map` and `export` show.</source>
        <translation>Ajoute à la base des colonnes que `semsig info`, `map` et `export` montrent.</translation>
    </message>
    <message>
        <source>Age of the map</source>
        <translation>Âge de la carte</translation>
    </message>
    <message>
        <source>Age of the map, from the survey of its objects to the query.</source>
        <translation>Âge de la carte, du relevé de ses objets à la requête.</translation>
    </message>
    <message>
        <source>All layers</source>
        <translation>Toutes les couches</translation>
    </message>
    <message>
        <source>Also remove the street objects, which updates and refined places need.</source>
        <translation>Supprimer aussi les objets de rue, dont les mises à jour et les lieux affinés ont besoin.</translation>
    </message>
    <message>
        <source>Also search between the centres of cells.</source>
        <translation>Chercher aussi entre les centres des cellules.</translation>
    </message>
    <message>
        <source>Also the street objects</source>
        <translation>Aussi les objets de rue</translation>
    </message>
    <message>
        <source>Ambiguity</source>
        <translation>Ambiguïté</translation>
    </message>
    <message>
        <source>Angle levels</source>
        <translation>Niveaux d’angle</translation>
    </message>
    <message>
        <source>Angle that the camera is rolled clockwise.</source>
        <translation>Angle dont la caméra est tournée dans le sens des aiguilles d’une montre.</translation>
    </message>
    <message>
        <source>Angle that the camera points upwards.</source>
        <translation>Angle dont la caméra pointe vers le haut.</translation>
    </message>
    <message>
        <source>Another signature database, built in the same way.</source>
        <translation>Une autre base de signatures, construite de la même façon.</translation>
    </message>
    <message>
        <source>Answer</source>
        <translation>Réponse</translation>
    </message>
    <message>
        <source>Apply changed street objects to a database.</source>
        <translation>Applique des objets de rue modifiés à une base.</translation>
    </message>
    <message>
        <source>Apply the catalogue's filters.</source>
        <translation>Appliquer les filtres du catalogue.</translation>
    </message>
    <message>
        <source>Area</source>
        <translation>Zone</translation>
    </message>
    <message>
        <source>Area to keep</source>
        <translation>Zone à garder</translation>
    </message>
    <message>
        <source>Ask</source>
        <translation>Interroger</translation>
    </message>
    <message>
        <source>Assume that views are from the area of the database. Otherwise the chance that they are from elsewhere is 50 % before their objects are compared.</source>
        <translation>Supposer que les vues viennent de la zone de la base. Sinon, la probabilité qu’elles viennent d’ailleurs est de 50 % avant que leurs objets soient comparés.</translation>
    </message>
    <message>
        <source>Assume that views are from the centre of a cell, as in the paper, instead of from anywhere in it.</source>
        <translation>Supposer que les vues sont prises du centre d’une cellule, comme dans l’article, et non de n’importe où en elle.</translation>
    </message>
    <message>
        <source>At places every 10 m along the streets, the objects in sight are counted, and then what optional layers add. Where few are seen, a view fits many places.</source>
        <translation>Tous les 10 m le long des rues, les objets visibles sont comptés, puis ce qu’ajoutent les couches facultatives. Là où peu d’objets sont visibles, une vue correspond à de nombreux lieux.</translation>
    </message>
    <message>
        <source>Bearing of the middle of the photo.</source>
        <translation>Azimut du milieu de la photo.</translation>
    </message>
    <message>
        <source>Bearing of the photo</source>
        <translation>Azimut de la photo</translation>
    </message>
    <message>
        <source>Bearings</source>
        <translation>Azimuts</translation>
    </message>
    <message>
        <source>Benchmark on photographs</source>
        <translation>Banc d’essai sur des photos</translation>
    </message>
    <message>
        <source>Best place: {place}</source>
        <translation>Meilleur lieu : {place}</translation>
    </message>
    <message>
        <source>Box in degrees, a polygon file, or the name of a place.</source>
        <translation>Emprise en degrés, fichier de polygones, ou nom d’un lieu.</translation>
    </message>
    <message>
        <source>Build a signature database from street objects.</source>
        <translation>Construit une base de signatures à partir d’objets de rue.</translation>
    </message>
    <message>
        <source>Build signature database</source>
        <translation>Construire la base de signatures</translation>
    </message>
    <message>
        <source>Building footprints that hide what is behind them.</source>
        <translation>Emprises de bâtiments qui cachent ce qui est derrière elles.</translation>
    </message>
    <message>
        <source>Building footprints to write (.parquet).</source>
        <translation>Emprises de bâtiments à écrire (.parquet).</translation>
    </message>
    <message>
        <source>Buildings</source>
        <translation>Bâtiments</translation>
    </message>
    <message>
        <source>Buildings and streets</source>
        <translation>Bâtiments et rues</translation>
    </message>
    <message>
        <source>Buildings and streets of the street objects</source>
        <translation>Bâtiments et rues des objets de rue</translation>
    </message>
    <message>
        <source>By likelihood, every place gets a chance. A method by distance takes only what was seen and --require of what is known, and cannot explain.</source>
        <translation>Avec la méthode likelihood, chaque lieu reçoit une probabilité. Une méthode par distance n’utilise que ce qui a été vu et, de ce qui est connu, --require, et ne peut rien expliquer.</translation>
    </message>
    <message>
        <source>CRS in metres to work in.</source>
        <translation>SCR en mètres dans lequel travailler.</translation>
    </message>
    <message>
        <source>CRS of files that do not state their own, such as EPSG:2154.</source>
        <translation>SCR des fichiers qui n’indiquent pas le leur, comme EPSG:2154.</translation>
    </message>
    <message>
        <source>CRS of the files</source>
        <translation>SCR des fichiers</translation>
    </message>
    <message>
        <source>CRS to work in</source>
        <translation>SCR de travail</translation>
    </message>
    <message>
        <source>Calibrate the answers</source>
        <translation>Étalonner les réponses</translation>
    </message>
    <message>
        <source>Camera data</source>
        <translation>Données de caméra</translation>
    </message>
    <message>
        <source>Camera data of single pictures: a CSV or JSON lines file with image and any of camera, fov, heading, heading_error, pitch, roll and place.</source>
        <translation>Données de caméra de certaines images : un fichier CSV ou JSON par lignes avec image et au choix camera, fov, heading, heading_error, pitch, roll et place.</translation>
    </message>
    <message>
        <source>Cancel</source>
        <translation>Annuler</translation>
    </message>
    <message>
        <source>Cancelled; the previous state was not changed.</source>
        <translation>Annulé ; l’état précédent n’a pas changé.</translation>
    </message>
    <message>
        <source>Candidates</source>
        <translation>Candidats</translation>
    </message>
    <message>
        <source>Candidates that count</source>
        <translation>Candidats qui comptent</translation>
    </message>
    <message>
        <source>Cannot tell: 90 % of the chance is in {cells} cells, and {chance} within {metres} m of the best place.</source>
        <translation>Impossible à dire : 90 % de la probabilité est dans {cells} cellules, et {chance} à moins de {metres} m du meilleur lieu.</translation>
    </message>
    <message>
        <source>Catalogue</source>
        <translation>Catalogue</translation>
    </message>
    <message>
        <source>Catalogue with a service, by name or .toml.</source>
        <translation>Catalogue avec un service, par son nom ou en .toml.</translation>
    </message>
    <message>
        <source>Catalogue, by name or .toml file; default: list all.</source>
        <translation>Catalogue, par son nom ou un fichier .toml ; par défaut, tous sont énumérés.</translation>
    </message>
    <message>
        <source>Catalogue, by name or .toml file; not needed for OpenStreetMap and Overture. Repeat to merge several, best first.</source>
        <translation>Catalogue, par son nom ou un fichier .toml ; inutile pour OpenStreetMap et Overture. Plusieurs sont fusionnés, le meilleur d’abord.</translation>
    </message>
    <message>
        <source>Catalogues</source>
        <translation>Catalogues</translation>
    </message>
    <message>
        <source>Catalogues of open data</source>
        <translation>Catalogues de données ouvertes</translation>
    </message>
    <message>
        <source>Cells</source>
        <translation>Cellules</translation>
    </message>
    <message>
        <source>Centre lines of streets to write (.parquet).</source>
        <translation>Axes de rues à écrire (.parquet).</translation>
    </message>
    <message>
        <source>Centre lines of streets, for maps, names of places and viewpoints near streets.</source>
        <translation>Axes de rues, pour les cartes, les noms des lieux et les points de vue près des rues.</translation>
    </message>
    <message>
        <source>Centre lines to draw below the map.</source>
        <translation>Axes à dessiner sous la carte.</translation>
    </message>
    <message>
        <source>Chance</source>
        <translation>Probabilité</translation>
    </message>
    <message>
        <source>Chance of the regions</source>
        <translation>Probabilité des régions</translation>
    </message>
    <message>
        <source>Changes</source>
        <translation>Changements</translation>
    </message>
    <message>
        <source>Choose a rank in the list to go there.</source>
        <translation>Choisissez un rang dans la liste pour y aller.</translation>
    </message>
    <message>
        <source>Choose a signature database, and open it.</source>
        <translation>Choisissez une base de signatures et ouvrez-la.</translation>
    </message>
    <message>
        <source>Choose from which chance on a place is given as an answer.</source>
        <translation>Choisit à partir de quelle probabilité un lieu est donné comme réponse.</translation>
    </message>
    <message>
        <source>Choose what you see, and click its direction in the dial. Click an object to remove it.</source>
        <translation>Choisissez ce que vous voyez, puis cliquez sa direction dans le cadran. Un clic sur un objet l’enlève.</translation>
    </message>
    <message>
        <source>Class of false objects</source>
        <translation>Classe des faux objets</translation>
    </message>
    <message>
        <source>Clear</source>
        <translation>Effacer</translation>
    </message>
    <message>
        <source>Click a cell</source>
        <translation>Cliquer une cellule</translation>
    </message>
    <message>
        <source>Close</source>
        <translation>Fermer</translation>
    </message>
    <message>
        <source>Collapse objects of a class</source>
        <translation>Réunir les objets d’une classe</translation>
    </message>
    <message>
        <source>Collapse objects of a class at the same place.</source>
        <translation>Réunir les objets d’une classe au même lieu.</translation>
    </message>
    <message>
        <source>Compare results</source>
        <translation>Comparer des résultats</translation>
    </message>
    <message>
        <source>Compare two results of queries from the same places.</source>
        <translation>Compare deux résultats de requêtes des mêmes lieux.</translation>
    </message>
    <message>
        <source>Composes the view that is seen from a place of the map.</source>
        <translation>Compose la vue que l’on a d’un lieu de la carte.</translation>
    </message>
    <message>
        <source>Corner of a cell in metres, in the CRS of the objects.</source>
        <translation>Coin d’une cellule en mètres, dans le SCR des objets.</translation>
    </message>
    <message>
        <source>Count the best of this many candidates (t).</source>
        <translation>Compter le meilleur de ce nombre de candidats (t).</translation>
    </message>
    <message>
        <source>Data set</source>
        <translation>Jeu de données</translation>
    </message>
    <message>
        <source>Data set: flatlandia or london-lights.</source>
        <translation>Jeu de données : flatlandia ou london-lights.</translation>
    </message>
    <message>
        <source>Database of another city</source>
        <translation>Base d’une autre ville</translation>
    </message>
    <message>
        <source>Database of another city: also count how many of its views are answered, which is wrong for all of them.</source>
        <translation>Base d’une autre ville : compter aussi combien de ses vues reçoivent une réponse, ce qui est faux pour toutes.</translation>
    </message>
    <message>
        <source>Database to write.</source>
        <translation>Base à écrire.</translation>
    </message>
    <message>
        <source>Day of the view</source>
        <translation>Jour de la vue</translation>
    </message>
    <message>
        <source>Day of the view, for magnetic north.</source>
        <translation>Jour de la vue, pour le nord magnétique.</translation>
    </message>
    <message>
        <source>Default street width, where --streets has none.</source>
        <translation>Largeur de rue par défaut, là où --streets n’en a pas.</translation>
    </message>
    <message>
        <source>Default: {}.</source>
        <translation>Par défaut : {}.</translation>
    </message>
    <message>
        <source>Degrees clockwise from north, such as 10,80,200,310.</source>
        <translation>Degrés à partir du nord dans le sens des aiguilles d’une montre, comme 10,80,200,310.</translation>
    </message>
    <message>
        <source>Demonstration</source>
        <translation>Démonstration</translation>
    </message>
    <message>
        <source>Detections of known places</source>
        <translation>Détections de lieux connus</translation>
    </message>
    <message>
        <source>Detections of known places: a CSV or JSON lines file of views with x and y (metres) or cell_id (its centre).</source>
        <translation>Détections de lieux connus : un fichier de vues en CSV ou JSON par lignes avec x et y (mètres) ou cell_id (son centre).</translation>
    </message>
    <message>
        <source>Detections: COCO, Label Studio, LabelMe, VIA, Supervisely, Darwin, Datumaro, BDD100K, Mapillary, Panoramax, Ultralytics, Transformers or supervision JSON, answers of Rekognition, Vision or Roboflow, CVAT or Pascal VOC XML, YOLO .txt with data.yaml, KITTI .txt, CSV of Roboflow or Label Studio; or a folder. With --detector: photographs, or folders of them.</source>
        <translation>Détections : JSON de COCO, Label Studio, LabelMe, VIA, Supervisely, Darwin, Datumaro, BDD100K, Mapillary, Panoramax, Ultralytics, Transformers ou supervision, réponses de Rekognition, Vision ou Roboflow, XML de CVAT ou Pascal VOC, .txt de YOLO avec data.yaml, .txt de KITTI, CSV de Roboflow ou de Label Studio ; ou un dossier. Avec --detector : des photos, ou des dossiers de photos.</translation>
    </message>
    <message>
        <source>Direction of the camera, clockwise from north.</source>
        <translation>Direction de la caméra, à partir du nord dans le sens des aiguilles d’une montre.</translation>
    </message>
    <message>
        <source>Distance to add around the cells of --out.</source>
        <translation>Distance à ajouter autour des cellules de --out.</translation>
    </message>
    <message>
        <source>Distort queries: none, light, medium or strong, or several, such as medium,compass:10,view:90.</source>
        <translation>Déformer les requêtes : none (pas du tout), light (peu), medium (moyen) ou strong (beaucoup), ou plusieurs, comme medium,compass:10,view:90.</translation>
    </message>
    <message>
        <source>Distortion</source>
        <translation>Distorsion</translation>
    </message>
    <message>
        <source>Do not sort the objects again after the bearing noise.</source>
        <translation>Ne pas trier à nouveau les objets après les erreurs d’azimut.</translation>
    </message>
    <message>
        <source>Download OpenStreetMap for this canvas</source>
        <translation>Télécharger OpenStreetMap pour cette carte</translation>
    </message>
    <message>
        <source>Download street objects</source>
        <translation>Télécharger les objets de rue</translation>
    </message>
    <message>
        <source>Download the street objects of OpenStreetMap in a part of the map, from an Overpass server.</source>
        <translation>Télécharge les objets de rue d’OpenStreetMap dans une partie de la carte, d’un serveur Overpass.</translation>
    </message>
    <message>
        <source>Download the street objects of an area.</source>
        <translation>Télécharge les objets de rue d’une zone.</translation>
    </message>
    <message>
        <source>Draft a catalogue</source>
        <translation>Ébaucher un catalogue</translation>
    </message>
    <message>
        <source>Draft a catalogue for a vector file or a folder of files, for you to edit.</source>
        <translation>Ébauche un catalogue pour un fichier vectoriel ou un dossier de fichiers, à modifier par vous.</translation>
    </message>
    <message>
        <source>Draw a map</source>
        <translation>Dessiner une carte</translation>
    </message>
    <message>
        <source>Draw an answer: the .tif file that `semsig localize --out` wrote.</source>
        <translation>Dessiner une réponse : le fichier .tif que `semsig localize --out` a écrit.</translation>
    </message>
    <message>
        <source>Draw cells, evaluations, changes, answers or objects on a map.</source>
        <translation>Dessine des cellules, des évaluations, des changements, des réponses ou des objets sur une carte.</translation>
    </message>
    <message>
        <source>Draw how many cells look the same.</source>
        <translation>Dessiner combien de cellules se ressemblent.</translation>
    </message>
    <message>
        <source>Draw how well cells can be found (after `semsig identify`).</source>
        <translation>Dessiner avec quelle facilité les cellules peuvent être trouvées (après `semsig identify`).</translation>
    </message>
    <message>
        <source>Draw online tiles below the map, of a provider of xyzservices that needs no key, such as OpenStreetMap.Mapnik.</source>
        <translation>Dessiner des tuiles en ligne sous la carte, d’un fournisseur de xyzservices qui ne demande pas de clé, comme OpenStreetMap.Mapnik.</translation>
    </message>
    <message>
        <source>Draw street objects written by `semsig load`.</source>
        <translation>Dessiner des objets de rue écrits par `semsig load`.</translation>
    </message>
    <message>
        <source>Draw the changes up to this newer database.</source>
        <translation>Dessiner les changements jusqu’à cette base plus récente.</translation>
    </message>
    <message>
        <source>Ellipse of the place</source>
        <translation>Ellipse du lieu</translation>
    </message>
    <message>
        <source>Engine of Semantic signatures</source>
        <translation>Moteur de Signatures sémantiques</translation>
    </message>
    <message>
        <source>Engine...</source>
        <translation>Moteur…</translation>
    </message>
    <message>
        <source>Error of the heading</source>
        <translation>Erreur du cap</translation>
    </message>
    <message>
        <source>Errors of the detector</source>
        <translation>Erreurs du détecteur</translation>
    </message>
    <message>
        <source>Errors of the detector or person: light, medium, strong, generic (any of them), by-hand, photo, panorama, or a file written by `semsig learn`.</source>
        <translation>Erreurs du détecteur ou de la personne : light (peu), medium (moyen), strong (beaucoup), generic (n’importe lequel), by-hand, photo, panorama, ou un fichier écrit par `semsig learn`.</translation>
    </message>
    <message>
        <source>Errors of the detector: light, medium, strong, generic (any of them), by-hand (a person, who leaves some out), photo, panorama, or a file written by `semsig learn`.</source>
        <translation>Erreurs du détecteur : light (peu), medium (moyen), strong (beaucoup), generic (n’importe lequel), by-hand (une personne, qui en omet), photo, panorama, ou un fichier écrit par `semsig learn`.</translation>
    </message>
    <message>
        <source>Evaluate</source>
        <translation>Évaluer</translation>
    </message>
    <message>
        <source>Experiment</source>
        <translation>Expérience</translation>
    </message>
    <message>
        <source>Experiment, a .toml file.</source>
        <translation>Expérience, un fichier .toml.</translation>
    </message>
    <message>
        <source>Explain the best places</source>
        <translation>Expliquer les meilleurs lieux</translation>
    </message>
    <message>
        <source>Explore a city</source>
        <translation>Explorer une ville</translation>
    </message>
    <message>
        <source>Export cells, objects and queries for QGIS and other programs.</source>
        <translation>Exporte des cellules, des objets et des requêtes pour QGIS et d’autres programmes.</translation>
    </message>
    <message>
        <source>Export to other programs</source>
        <translation>Exporter vers d’autres programmes</translation>
    </message>
    <message>
        <source>Field of view</source>
        <translation>Champ de vision</translation>
    </message>
    <message>
        <source>Field of view of a photo, around --look.</source>
        <translation>Champ de vision d’une photo, autour de --look.</translation>
    </message>
    <message>
        <source>Field of view of a query, in any direction.</source>
        <translation>Champ de vision d’une requête, dans une direction quelconque.</translation>
    </message>
    <message>
        <source>File</source>
        <translation>Fichier</translation>
    </message>
    <message>
        <source>File of many queries, as CSV or JSON lines, or - for JSON lines from standard input. Prints a line of JSON for each: an answer or an error.</source>
        <translation>Fichier de nombreuses requêtes en CSV ou JSON par lignes, ou - pour du JSON par lignes sur l’entrée standard. Écrit pour chacune une ligne JSON : une réponse ou une erreur.</translation>
    </message>
    <message>
        <source>File of queries</source>
        <translation>Fichier de requêtes</translation>
    </message>
    <message>
        <source>File to write</source>
        <translation>Fichier à écrire</translation>
    </message>
    <message>
        <source>File to write. Its suffix is the format: .csv, .fgb, .geojson, .gpkg, .parquet, .pmtiles, .tif or .json. A .gpkg (for QGIS) has all layers, .pmtiles (for web maps) the cells, .tif a raster of the cells, .json a description (STAC item), and other formats one layer.</source>
        <translation>Fichier à écrire. Son suffixe est le format : .csv, .fgb, .geojson, .gpkg, .parquet, .pmtiles, .tif ou .json. Un .gpkg (pour QGIS) contient toutes les couches, .pmtiles (pour cartes web) les cellules, .tif un raster des cellules, .json une description (élément STAC), les autres formats une couche.</translation>
    </message>
    <message>
        <source>File to write: search regions and candidates for QGIS (.gpkg) or in degrees (.geojson, .kml), only the regions (.parquet, .fgb, .csv), or the chance of every cell (.tif).</source>
        <translation>Fichier à écrire : régions et candidats pour QGIS (.gpkg) ou en degrés (.geojson, .kml), seulement les régions (.parquet, .fgb, .csv), ou la probabilité de chaque cellule (.tif).</translation>
    </message>
    <message>
        <source>Files</source>
        <translation>Fichiers</translation>
    </message>
    <message>
        <source>Files, or a folder of files.</source>
        <translation>Fichiers, ou un dossier de fichiers.</translation>
    </message>
    <message>
        <source>Filters of the catalogue</source>
        <translation>Filtres du catalogue</translation>
    </message>
    <message>
        <source>Find a class</source>
        <translation>Chercher une classe</translation>
    </message>
    <message>
        <source>Find the place</source>
        <translation>Trouver le lieu</translation>
    </message>
    <message>
        <source>Find where a view was seen from, or many views.</source>
        <translation>Trouve d’où une vue, ou de nombreuses vues, ont été prises.</translation>
    </message>
    <message>
        <source>Find where the views of a route were seen from.</source>
        <translation>Trouve d’où les vues d’un trajet ont été prises.</translation>
    </message>
    <message>
        <source>First database</source>
        <translation>Première base</translation>
    </message>
    <message>
        <source>First noise model</source>
        <translation>Premier modèle d’erreurs</translation>
    </message>
    <message>
        <source>First noise model for --unlabelled, a name or a file.</source>
        <translation>Premier modèle d’erreurs pour --unlabelled, un nom ou un fichier.</translation>
    </message>
    <message>
        <source>Folder</source>
        <translation>Dossier</translation>
    </message>
    <message>
        <source>Folder for the results</source>
        <translation>Dossier des résultats</translation>
    </message>
    <message>
        <source>Folder of an experiment or of an evaluation.</source>
        <translation>Dossier d’une expérience ou d’une évaluation.</translation>
    </message>
    <message>
        <source>Folder of results</source>
        <translation>Dossier de résultats</translation>
    </message>
    <message>
        <source>Folder of the cache</source>
        <translation>Dossier du cache</translation>
    </message>
    <message>
        <source>Folder of the cache.</source>
        <translation>Dossier du cache.</translation>
    </message>
    <message>
        <source>Folder of the check</source>
        <translation>Dossier de la vérification</translation>
    </message>
    <message>
        <source>Folder of the pictures</source>
        <translation>Dossier des images</translation>
    </message>
    <message>
        <source>Folder of the pictures, to read focal length and heading from EXIF.</source>
        <translation>Dossier des images, pour lire la focale et le cap dans EXIF.</translation>
    </message>
    <message>
        <source>Folder of wheels</source>
        <translation>Dossier de wheels</translation>
    </message>
    <message>
        <source>Folder of wheels (leave empty to download them)</source>
        <translation>Dossier de wheels (laisser vide pour les télécharger)</translation>
    </message>
    <message>
        <source>Folder to write a report of the check to.</source>
        <translation>Dossier dans lequel écrire un rapport de la vérification.</translation>
    </message>
    <message>
        <source>Folder to write the report and results to.</source>
        <translation>Dossier dans lequel écrire le rapport et les résultats.</translation>
    </message>
    <message>
        <source>Folder to write the results to.</source>
        <translation>Dossier dans lequel écrire les résultats.</translation>
    </message>
    <message>
        <source>Folder to write to.</source>
        <translation>Dossier dans lequel écrire.</translation>
    </message>
    <message>
        <source>Folder with the files of the data set.</source>
        <translation>Dossier des fichiers du jeu de données.</translation>
    </message>
    <message>
        <source>Folder written by `semsig evaluate --out`, to add its queries.</source>
        <translation>Dossier écrit par `semsig evaluate --out`, dont les requêtes sont ajoutées.</translation>
    </message>
    <message>
        <source>Folder written by `semsig evaluate --out`.</source>
        <translation>Dossier écrit par `semsig evaluate --out`.</translation>
    </message>
    <message>
        <source>Footprints to draw below the map.</source>
        <translation>Emprises à dessiner sous la carte.</translation>
    </message>
    <message>
        <source>Found: the place is within {metres} m with a chance of {chance}.</source>
        <translation>Trouvé : le lieu est à moins de {metres} m avec une probabilité de {chance}.</translation>
    </message>
    <message>
        <source>From the centres of cells</source>
        <translation>Depuis le centre des cellules</translation>
    </message>
    <message>
        <source>From the true to the best place</source>
        <translation>Du vrai lieu au meilleur</translation>
    </message>
    <message>
        <source>GPX track</source>
        <translation>Trace GPX</translation>
    </message>
    <message>
        <source>GPX track of the route, matched by the time of each view, or with one point for each view.</source>
        <translation>Trace GPX du trajet, associée par l’heure de chaque vue, ou avec un point pour chaque vue.</translation>
    </message>
    <message>
        <source>GeoPackage</source>
        <translation>GeoPackage</translation>
    </message>
    <message>
        <source>GeoPackage written by `semsig export`.</source>
        <translation>GeoPackage écrit par `semsig export`.</translation>
    </message>
    <message>
        <source>Give up a download after this time, all attempts together.</source>
        <translation>Abandonner un téléchargement après ce temps, tous essais compris.</translation>
    </message>
    <message>
        <source>Grey</source>
        <translation>Gris</translation>
    </message>
    <message>
        <source>Heading</source>
        <translation>Cap</translation>
    </message>
    <message>
        <source>Help</source>
        <translation>Aide</translation>
    </message>
    <message>
        <source>Hexagons</source>
        <translation>Hexagones</translation>
    </message>
    <message>
        <source>Horizontal field of view.</source>
        <translation>Champ de vision horizontal.</translation>
    </message>
    <message>
        <source>How a cell is drawn.</source>
        <translation>Comment une cellule est dessinée : polygone (polygon) ou point (point).</translation>
    </message>
    <message>
        <source>How the class of a false object is drawn.</source>
        <translation>Comment la classe d’un faux objet est tirée.</translation>
    </message>
    <message>
        <source>Identifiability</source>
        <translation>Identifiabilité</translation>
    </message>
    <message>
        <source>Import from QGIS</source>
        <translation>Importer de QGIS</translation>
    </message>
    <message>
        <source>Install</source>
        <translation>Installer</translation>
    </message>
    <message>
        <source>Install again</source>
        <translation>Réinstaller</translation>
    </message>
    <message>
        <source>Installing the engine of Semantic signatures</source>
        <translation>Installation du moteur de Signatures sémantiques</translation>
    </message>
    <message>
        <source>Keep only what is in this box in degrees, in the polygons of a file, or with 'box' in the box that OpenStreetMap files state; with 'none' keep all.</source>
        <translation>Ne garder que ce qui est dans cette emprise en degrés, dans les polygones d’un fichier, ou avec 'box' dans l’emprise que les fichiers OpenStreetMap indiquent ; avec 'none', tout garder.</translation>
    </message>
    <message>
        <source>Keep the cells in this box in degrees, or in polygons.</source>
        <translation>Garder les cellules de cette emprise en degrés, ou des polygones.</translation>
    </message>
    <message>
        <source>Keep the order of the objects</source>
        <translation>Garder l’ordre des objets</translation>
    </message>
    <message>
        <source>Largest distortion allowed for the CRS: degrees of bearings, percent of lengths.</source>
        <translation>Plus grande déformation admise pour le SCR : degrés des azimuts, pour cent des longueurs.</translation>
    </message>
    <message>
        <source>Largest distortion of the CRS</source>
        <translation>Plus grande déformation du SCR</translation>
    </message>
    <message>
        <source>Largest error</source>
        <translation>Plus grande erreur</translation>
    </message>
    <message>
        <source>Largest error that counts as found.</source>
        <translation>Plus grande erreur qui compte comme trouvée.</translation>
    </message>
    <message>
        <source>Last known place</source>
        <translation>Dernier lieu connu</translation>
    </message>
    <message>
        <source>Last known place, in degrees or as X,Y,SIGMA in the CRS of the database, SIGMA in metres.</source>
        <translation>Dernier lieu connu, en degrés ou sous la forme X,Y,SIGMA dans le SCR de la base, SIGMA en mètres.</translation>
    </message>
    <message>
        <source>Layer to write, by default cells, in a .gpkg all: buildings, cells, evaluation, evaluation_lines, hexagons, objects, streets (repeat for several). In a .tif, by default ambiguity: ambiguity, error, field, identifiability.</source>
        <translation>Couche à écrire, par défaut cells, dans un .gpkg toutes : buildings, cells, evaluation, evaluation_lines, hexagons, objects, streets (plusieurs sont possibles). Dans un .tif, par défaut ambiguity : ambiguity, error, field, identifiability.</translation>
    </message>
    <message>
        <source>Layers</source>
        <translation>Couches</translation>
    </message>
    <message>
        <source>Learn detector errors</source>
        <translation>Apprendre les erreurs d’un détecteur</translation>
    </message>
    <message>
        <source>Learn the errors of a detector from detections of known places, or only from its views.</source>
        <translation>Apprend les erreurs d’un détecteur à partir de détections de lieux connus, ou seulement de ses vues.</translation>
    </message>
    <message>
        <source>Leave out boxes with a lower score.</source>
        <translation>Omettre les cadres d’un score inférieur.</translation>
    </message>
    <message>
        <source>Letters of classes</source>
        <translation>Lettres des classes</translation>
    </message>
    <message>
        <source>List the catalogues, or the layers of one.</source>
        <translation>Énumère les catalogues, ou les couches de l’un d’eux.</translation>
    </message>
    <message>
        <source>List what would be removed, but remove nothing.</source>
        <translation>Énumérer ce qui serait supprimé, mais ne rien supprimer.</translation>
    </message>
    <message>
        <source>Load street objects</source>
        <translation>Charger les objets de rue</translation>
    </message>
    <message>
        <source>Localize</source>
        <translation>Localiser</translation>
    </message>
    <message>
        <source>Localize a route</source>
        <translation>Localiser un trajet</translation>
    </message>
    <message>
        <source>Look</source>
        <translation>Regarder</translation>
    </message>
    <message>
        <source>Look only at places in this box in degrees, or in polygons.</source>
        <translation>Ne considérer que les lieux dans ce rectangle en degrés, ou dans des polygones.</translation>
    </message>
    <message>
        <source>Looking for Python...</source>
        <translation>Recherche de Python…</translation>
    </message>
    <message>
        <source>Lowest score</source>
        <translation>Score le plus bas</translation>
    </message>
    <message>
        <source>Make up a city</source>
        <translation>Inventer une ville</translation>
    </message>
    <message>
        <source>Make up a city: street objects, buildings and streets.</source>
        <translation>Invente une ville : objets de rue, bâtiments et rues.</translation>
    </message>
    <message>
        <source>Map from labels to classes, by name or .toml file; repeat for several, best first. With --detector also the names of its classes: coco, or a .txt, .yaml or .json file (default: from the model).</source>
        <translation>Correspondance entre étiquettes et classes, par son nom ou un fichier .toml ; plusieurs sont possibles, la meilleure d’abord. Avec --detector aussi les noms de ses classes : coco, ou un fichier .txt, .yaml ou .json (par défaut : du modèle).</translation>
    </message>
    <message>
        <source>Map page</source>
        <translation>Page de carte</translation>
    </message>
    <message>
        <source>Map to write (.html).</source>
        <translation>Carte à écrire (.html).</translation>
    </message>
    <message>
        <source>Maps of labels</source>
        <translation>Correspondances des étiquettes</translation>
    </message>
    <message>
        <source>Margin of the regions</source>
        <translation>Marge des régions</translation>
    </message>
    <message>
        <source>Measure</source>
        <translation>Mesurer</translation>
    </message>
    <message>
        <source>Measure how often, and how closely, queries from known places are located.</source>
        <translation>Mesure à quelle fréquence et avec quelle précision les requêtes de lieux connus sont localisées.</translation>
    </message>
    <message>
        <source>Measure methods on real photographs with known places.</source>
        <translation>Mesure des méthodes sur de vraies photos de lieux connus.</translation>
    </message>
    <message>
        <source>Merge objects of different layers within the catalogue's radii.</source>
        <translation>Fusionner les objets de couches différentes dans les rayons du catalogue.</translation>
    </message>
    <message>
        <source>Merge objects of layers</source>
        <translation>Fusionner les objets des couches</translation>
    </message>
    <message>
        <source>Merge signature databases</source>
        <translation>Fusionner des bases de signatures</translation>
    </message>
    <message>
        <source>Merge the databases of two places into one.</source>
        <translation>Fusionne les bases de deux lieux en une.</translation>
    </message>
    <message>
        <source>Merged database</source>
        <translation>Base fusionnée</translation>
    </message>
    <message>
        <source>Method</source>
        <translation>Méthode</translation>
    </message>
    <message>
        <source>Method of the paper</source>
        <translation>Méthode de l’article</translation>
    </message>
    <message>
        <source>Methods</source>
        <translation>Méthodes</translation>
    </message>
    <message>
        <source>Methods with commas between them; --out has the worst failures of the last one.</source>
        <translation>Méthodes séparées par des virgules ; --out contient les pires échecs de la dernière.</translation>
    </message>
    <message>
        <source>Missed and false objects that the age of the map explains do not count.</source>
        <translation>Les objets manqués ou faux que l’âge de la carte explique ne comptent pas.</translation>
    </message>
    <message>
        <source>More databases</source>
        <translation>Autres bases</translation>
    </message>
    <message>
        <source>More databases before what was seen: the view may be from any of these cities.</source>
        <translation>Autres bases avant ce qui a été vu : la vue peut venir de n’importe laquelle de ces villes.</translation>
    </message>
    <message>
        <source>Most views</source>
        <translation>Nombre maximal de vues</translation>
    </message>
    <message>
        <source>New street objects</source>
        <translation>Nouveaux objets de rue</translation>
    </message>
    <message>
        <source>New street objects; their layers replace layers of the database.</source>
        <translation>Nouveaux objets de rue ; leurs couches remplacent des couches de la base.</translation>
    </message>
    <message>
        <source>Noise model</source>
        <translation>Modèle d’erreurs</translation>
    </message>
    <message>
        <source>Noise model of the method learned, written by `semsig learn`.</source>
        <translation>Modèle d’erreurs de la méthode learned, écrit par `semsig learn`.</translation>
    </message>
    <message>
        <source>Noise model to write (.toml or .json), for --noise.</source>
        <translation>Modèle d’erreurs à écrire (.toml ou .json), pour --noise.</translation>
    </message>
    <message>
        <source>North from which bearings are measured; grid north is that of the database.</source>
        <translation>Nord à partir duquel les azimuts sont mesurés ; le nord de la grille est celui de la base.</translation>
    </message>
    <message>
        <source>North is</source>
        <translation>Le nord est</translation>
    </message>
    <message>
        <source>North is unknown</source>
        <translation>Nord inconnu</translation>
    </message>
    <message>
        <source>North of the bearings</source>
        <translation>Nord des azimuts</translation>
    </message>
    <message>
        <source>Number of candidates</source>
        <translation>Nombre de candidats</translation>
    </message>
    <message>
        <source>Number of candidates.</source>
        <translation>Nombre de candidats.</translation>
    </message>
    <message>
        <source>Number of equal sectors in which the methods of the paper compare bearings.</source>
        <translation>Nombre de secteurs égaux dans lesquels les méthodes de l’article comparent les azimuts.</translation>
    </message>
    <message>
        <source>Number of new queries to check the predictions with.</source>
        <translation>Nombre de nouvelles requêtes avec lesquelles vérifier les prédictions.</translation>
    </message>
    <message>
        <source>Number of processes on this machine.</source>
        <translation>Nombre de processus sur cette machine.</translation>
    </message>
    <message>
        <source>Number of processes, 0 to use this one only.</source>
        <translation>Nombre de processus, 0 pour n’utiliser que celui-ci.</translation>
    </message>
    <message>
        <source>Number of queries</source>
        <translation>Nombre de requêtes</translation>
    </message>
    <message>
        <source>Number of queries to ask.</source>
        <translation>Nombre de requêtes à poser.</translation>
    </message>
    <message>
        <source>Number of queries.</source>
        <translation>Nombre de requêtes.</translation>
    </message>
    <message>
        <source>Number of threads.</source>
        <translation>Nombre de fils d’exécution.</translation>
    </message>
    <message>
        <source>Object detector</source>
        <translation>Détecteur d’objets</translation>
    </message>
    <message>
        <source>Object detector (.onnx) to run on photographs: YOLO, RT-DETR, DETR or torchvision. (needs the extra detect)</source>
        <translation>Détecteur d’objets (.onnx) à appliquer à des photos : YOLO, RT-DETR, DETR ou torchvision. (demande l’extra detect)</translation>
    </message>
    <message>
        <source>Objects in both are kept once, and cells near both are computed again.</source>
        <translation>Les objets présents dans les deux sont gardés une fois, et les cellules proches des deux sont recalculées.</translation>
    </message>
    <message>
        <source>Objects of the query</source>
        <translation>Objets de la requête</translation>
    </message>
    <message>
        <source>Older versions and interrupted runs leave them; the database is not changed.</source>
        <translation>Des versions antérieures et des exécutions interrompues les laissent ; la base n’est pas modifiée.</translation>
    </message>
    <message>
        <source>Online tiles</source>
        <translation>Tuiles en ligne</translation>
    </message>
    <message>
        <source>Only list the files</source>
        <translation>Seulement énumérer les fichiers</translation>
    </message>
    <message>
        <source>Only the classes of the paper</source>
        <translation>Seulement les classes de l’article</translation>
    </message>
    <message>
        <source>Open</source>
        <translation>Ouvrir</translation>
    </message>
    <message>
        <source>Open a database first.</source>
        <translation>Ouvrez d’abord une base.</translation>
    </message>
    <message>
        <source>Opening; a large city takes some seconds...</source>
        <translation>Ouverture ; une grande ville prend quelques secondes…</translation>
    </message>
    <message>
        <source>Origin</source>
        <translation>Origine</translation>
    </message>
    <message>
        <source>Overpass server (leave empty for the usual ones)</source>
        <translation>Serveur Overpass (laisser vide pour les serveurs habituels)</translation>
    </message>
    <message>
        <source>Pictures of one place</source>
        <translation>Images d’un même lieu</translation>
    </message>
    <message>
        <source>Pictures to join into one view: none (each), pictures with GPS positions within 5 m (gps), or all; a place in --photos takes precedence.</source>
        <translation>Images à réunir en une vue : aucune (each), celles dont les positions GPS sont à moins de 5 m (gps), ou toutes (all) ; un lieu dans --photos l’emporte.</translation>
    </message>
    <message>
        <source>Pitch</source>
        <translation>Tangage</translation>
    </message>
    <message>
        <source>Place</source>
        <translation>Lieu</translation>
    </message>
    <message>
        <source>Popularity of places</source>
        <translation>Popularité des lieux</translation>
    </message>
    <message>
        <source>Precision</source>
        <translation>Précision</translation>
    </message>
    <message>
        <source>Predict how well queries from each cell will be located.</source>
        <translation>Prédit avec quelle précision les requêtes de chaque cellule seront localisées.</translation>
    </message>
    <message>
        <source>Predict the accuracy</source>
        <translation>Prédire l’exactitude</translation>
    </message>
    <message>
        <source>Prepare</source>
        <translation>Préparer</translation>
    </message>
    <message>
        <source>Print the letters of classes, such as DDBL for what a cell sees.</source>
        <translation>Afficher les lettres des classes, comme DDBL pour ce que voit une cellule.</translation>
    </message>
    <message>
        <source>Print the properties of a database next to those in the paper.</source>
        <translation>Montre les propriétés d’une base à côté de celles de l’article.</translation>
    </message>
    <message>
        <source>Processes</source>
        <translation>Processus</translation>
    </message>
    <message>
        <source>Projection</source>
        <translation>Projection</translation>
    </message>
    <message>
        <source>Projection of the pictures.</source>
        <translation>Projection des images.</translation>
    </message>
    <message>
        <source>Properties of a database</source>
        <translation>Propriétés d’une base</translation>
    </message>
    <message>
        <source>Python (3.11 or newer)</source>
        <translation>Python (3.11 ou plus récent)</translation>
    </message>
    <message>
        <source>Python for the engine (leave empty to look for it)</source>
        <translation>Python pour le moteur (laisser vide pour le chercher)</translation>
    </message>
    <message>
        <source>Queries</source>
        <translation>Requêtes</translation>
    </message>
    <message>
        <source>Queries to check the predictions</source>
        <translation>Requêtes pour vérifier les prédictions</translation>
    </message>
    <message>
        <source>Radius of smoothing</source>
        <translation>Rayon de lissage</translation>
    </message>
    <message>
        <source>Radius over which an evaluation is smoothed.</source>
        <translation>Rayon sur lequel une évaluation est lissée.</translation>
    </message>
    <message>
        <source>Rank</source>
        <translation>Rang</translation>
    </message>
    <message>
        <source>Rank as the paper does: --method edit+edit:5%.</source>
        <translation>Classer comme l’article : --method edit+edit:5%.</translation>
    </message>
    <message>
        <source>Rank by likelihood, or by distance as TYPES+ANGLES (edit, histogram, jaccard), types:edit or angles:edit; add :5% for two stages, :alpha=0.7, :raw or :weights=INSERT/DELETE/SUBSTITUTE.</source>
        <translation>Classer par vraisemblance (likelihood), ou par distance sous la forme TYPES+ANGLES (edit, histogram, jaccard), types:edit ou angles:edit ; ajoutez :5% pour deux étapes, :alpha=0.7, :raw ou :weights=INSERT/DELETE/SUBSTITUTE.</translation>
    </message>
    <message>
        <source>Raster of how likely each place is beforehand, such as population.</source>
        <translation>Raster de la probabilité de chaque lieu a priori, comme la population.</translation>
    </message>
    <message>
        <source>Raster to write (.tif).</source>
        <translation>Raster à écrire (.tif).</translation>
    </message>
    <message>
        <source>Rate at which the city changes, for --map-age: output of `semsig update --years N --json`, or a .toml file with the same keys.</source>
        <translation>Taux auquel la ville change, pour --map-age : sortie de `semsig update --years N --json`, ou un fichier .toml avec les mêmes clés.</translation>
    </message>
    <message>
        <source>Rate of change</source>
        <translation>Taux de changement</translation>
    </message>
    <message>
        <source>Read files of open data into street objects.</source>
        <translation>Lit des fichiers de données ouvertes en objets de rue.</translation>
    </message>
    <message>
        <source>Read only the eleven classes of the paper.</source>
        <translation>Ne lire que les onze classes de l’article.</translation>
    </message>
    <message>
        <source>Read only this layer, or with +NAME also this one; may be repeated.</source>
        <translation>Ne lire que cette couche, ou avec +NAME lire aussi celle-ci ; plusieurs sont possibles.</translation>
    </message>
    <message>
        <source>Read the optional layers of objects as well.</source>
        <translation>Lire aussi les couches d’objets facultatives.</translation>
    </message>
    <message>
        <source>Regions to search</source>
        <translation>Régions à fouiller</translation>
    </message>
    <message>
        <source>Remove</source>
        <translation>Supprimer</translation>
    </message>
    <message>
        <source>Remove leftover files</source>
        <translation>Supprimer les fichiers restants</translation>
    </message>
    <message>
        <source>Remove leftover files next to a database.</source>
        <translation>Supprime les fichiers restés à côté d’une base.</translation>
    </message>
    <message>
        <source>Repeat the paper's experiments</source>
        <translation>Répéter les expériences de l’article</translation>
    </message>
    <message>
        <source>Repeat the paper's experiments and compare the results.</source>
        <translation>Répète les expériences de l’article et compare les résultats.</translation>
    </message>
    <message>
        <source>Report page</source>
        <translation>Page de rapport</translation>
    </message>
    <message>
        <source>Research</source>
        <translation>Rechercher</translation>
    </message>
    <message>
        <source>Resolution of hexagons</source>
        <translation>Résolution des hexagones</translation>
    </message>
    <message>
        <source>Restore a database from an exported GeoPackage.</source>
        <translation>Rétablit une base à partir d’un GeoPackage exporté.</translation>
    </message>
    <message>
        <source>Results</source>
        <translation>Résultats</translation>
    </message>
    <message>
        <source>Results to write (.json).</source>
        <translation>Résultats à écrire (.json).</translation>
    </message>
    <message>
        <source>Roll</source>
        <translation>Roulis</translation>
    </message>
    <message>
        <source>Rough distances</source>
        <translation>Distances approximatives</translation>
    </message>
    <message>
        <source>Rough distances: metres, near, middle, far or ?, such as 12,?,near.</source>
        <translation>Distances approximatives : mètres, near (proche), middle (moyenne), far (lointaine) ou ?, comme 12,?,near.</translation>
    </message>
    <message>
        <source>Rule for answers</source>
        <translation>Règle des réponses</translation>
    </message>
    <message>
        <source>Rule for when to answer, written by `semsig calibrate`.</source>
        <translation>Règle qui décide quand répondre, écrite par `semsig calibrate`.</translation>
    </message>
    <message>
        <source>Rule to write (.json), for --rule.</source>
        <translation>Règle à écrire (.json), pour --rule.</translation>
    </message>
    <message>
        <source>Run an experiment</source>
        <translation>Exécuter une expérience</translation>
    </message>
    <message>
        <source>Run every step on a small made-up town, offline.</source>
        <translation>Exécute chaque étape sur un petit bourg inventé, sans réseau.</translation>
    </message>
    <message>
        <source>Run the evaluations of an experiment, or resume them.</source>
        <translation>Exécute les évaluations d’une expérience, ou les reprend.</translation>
    </message>
    <message>
        <source>Run the paper's 10,000 queries, or 300 in a small city.</source>
        <translation>Exécuter les 10 000 requêtes de l’article, ou 300 dans une petite ville.</translation>
    </message>
    <message>
        <source>Say what the data of a place can carry, before you build.</source>
        <translation>Dit ce que permettent les données d’un lieu, avant la construction.</translation>
    </message>
    <message>
        <source>Scheduler</source>
        <translation>Ordonnanceur</translation>
    </message>
    <message>
        <source>Search between the centres of cells</source>
        <translation>Chercher entre les centres des cellules</translation>
    </message>
    <message>
        <source>Search only cells that see this: M (one or more), 2B (two or more), B=0 (none), ?&lt;=10 (at most ten objects).</source>
        <translation>Ne chercher que dans les cellules qui voient ceci : M (un ou plus), 2B (deux ou plus), B=0 (aucun), ?&lt;=10 (dix objets au plus).</translation>
    </message>
    <message>
        <source>Search only in this box in degrees, or in the polygons of a file.</source>
        <translation>Ne chercher que dans cette emprise en degrés, ou dans les polygones d’un fichier.</translation>
    </message>
    <message>
        <source>Second database</source>
        <translation>Deuxième base</translation>
    </message>
    <message>
        <source>Sectors</source>
        <translation>Secteurs</translation>
    </message>
    <message>
        <source>Sectors that were looked at, if not the full turn, such as 20-90,180-250.</source>
        <translation>Secteurs qui ont été regardés, sinon le tour complet, comme 20-90,180-250.</translation>
    </message>
    <message>
        <source>Seed</source>
        <translation>Graine</translation>
    </message>
    <message>
        <source>Seed of the random numbers.</source>
        <translation>Graine des nombres aléatoires.</translation>
    </message>
    <message>
        <source>Seed of the town and the queries.</source>
        <translation>Graine du bourg et des requêtes.</translation>
    </message>
    <message>
        <source>Seen from here</source>
        <translation>Vu d’ici</translation>
    </message>
    <message>
        <source>Seen from here: {seen}. {count} other cells see the same in this order.</source>
        <translation>Vu d’ici : {seen}. {count} autres cellules voient la même chose dans cet ordre.</translation>
    </message>
    <message>
        <source>Sees</source>
        <translation>Voit</translation>
    </message>
    <message>
        <source>Semantic signatures</source>
        <translation>Signatures sémantiques</translation>
    </message>
    <message>
        <source>Server</source>
        <translation>Serveur</translation>
    </message>
    <message>
        <source>Shape of a cell</source>
        <translation>Forme d’une cellule</translation>
    </message>
    <message>
        <source>Share of the answers that should be right.</source>
        <translation>Part des réponses qui doivent être justes.</translation>
    </message>
    <message>
        <source>Show how many cells see the same types in the same order.</source>
        <translation>Montre combien de cellules voient les mêmes types dans le même ordre.</translation>
    </message>
    <message>
        <source>Show which objects of the view match which street objects, which were missed and which look false.</source>
        <translation>Montrer quels objets de la vue correspondent à quels objets de rue, lesquels ont été manqués et lesquels semblent faux.</translation>
    </message>
    <message>
        <source>Shows what is seen from a cell, and the most similar cells.</source>
        <translation>Montre ce que l’on voit d’une cellule, et les cellules qui lui ressemblent le plus.</translation>
    </message>
    <message>
        <source>Side of a cell</source>
        <translation>Côté d’une cellule</translation>
    </message>
    <message>
        <source>Side of a cell.</source>
        <translation>Côté d’une cellule.</translation>
    </message>
    <message>
        <source>Side of the city</source>
        <translation>Côté de la ville</translation>
    </message>
    <message>
        <source>Side of the square city.</source>
        <translation>Côté de la ville carrée.</translation>
    </message>
    <message>
        <source>Signature cells</source>
        <translation>Cellules de signatures</translation>
    </message>
    <message>
        <source>Signature database</source>
        <translation>Base de signatures</translation>
    </message>
    <message>
        <source>Signature database in one file or in tiles.</source>
        <translation>Base de signatures en un fichier ou en tuiles.</translation>
    </message>
    <message>
        <source>Signature database to localize in; labels are mapped to its classes.</source>
        <translation>Base de signatures dans laquelle localiser ; les étiquettes sont rapportées à ses classes.</translation>
    </message>
    <message>
        <source>Signature database to write (.parquet), or a folder with tiles.</source>
        <translation>Base de signatures à écrire (.parquet), ou un dossier de tuiles.</translation>
    </message>
    <message>
        <source>Signature database to write (.parquet).</source>
        <translation>Base de signatures à écrire (.parquet).</translation>
    </message>
    <message>
        <source>Signature database written by `semsig build`.</source>
        <translation>Base de signatures écrite par `semsig build`.</translation>
    </message>
    <message>
        <source>Signature databases (*.parquet)</source>
        <translation>Bases de signatures (*.parquet)</translation>
    </message>
    <message>
        <source>Size of pictures where it is unknown, such as 1920x1080.</source>
        <translation>Taille des images là où elle est inconnue, comme 1920x1080.</translation>
    </message>
    <message>
        <source>Size of the experiments</source>
        <translation>Taille des expériences</translation>
    </message>
    <message>
        <source>Size of the pictures</source>
        <translation>Taille des images</translation>
    </message>
    <message>
        <source>Some square kilometres take seconds to minutes. What was downloaded before is taken from the cache. The server is a setting: Settings &gt; Options &gt; Processing &gt; Providers &gt; Semantic signatures.</source>
        <translation>Quelques kilomètres carrés prennent des secondes ou des minutes. Ce qui a déjà été téléchargé vient du cache. Le serveur se règle dans Préférences &gt; Options &gt; Traitement &gt; Fournisseurs &gt; Signatures sémantiques.</translation>
    </message>
    <message>
        <source>Squares of cells</source>
        <translation>Carrés des cellules</translation>
    </message>
    <message>
        <source>Standard deviation of the heading in degrees, or unknown.</source>
        <translation>Écart type du cap en degrés, ou unknown (inconnu).</translation>
    </message>
    <message>
        <source>Stopping...</source>
        <translation>Arrêt…</translation>
    </message>
    <message>
        <source>Street objects</source>
        <translation>Objets de rue</translation>
    </message>
    <message>
        <source>Street objects to add as a layer.</source>
        <translation>Objets de rue à ajouter comme couche.</translation>
    </message>
    <message>
        <source>Street objects to write (.parquet).</source>
        <translation>Objets de rue à écrire (.parquet).</translation>
    </message>
    <message>
        <source>Street objects to write, if exported.</source>
        <translation>Objets de rue à écrire, s’ils ont été exportés.</translation>
    </message>
    <message>
        <source>Street objects written by `semsig load`.</source>
        <translation>Objets de rue écrits par `semsig load`.</translation>
    </message>
    <message>
        <source>Street objects: a file written by `semsig load`, or an object store.</source>
        <translation>Objets de rue : un fichier écrit par `semsig load`, ou un magasin d’objets.</translation>
    </message>
    <message>
        <source>Street width</source>
        <translation>Largeur de rue</translation>
    </message>
    <message>
        <source>Streets</source>
        <translation>Rues</translation>
    </message>
    <message>
        <source>Suggest what to look for</source>
        <translation>Proposer quoi regarder</translation>
    </message>
    <message>
        <source>Suggest what to look for next, most useful first.</source>
        <translation>Propose quoi regarder ensuite, le plus utile d’abord.</translation>
    </message>
    <message>
        <source>Surely from this area</source>
        <translation>Sûrement de cette zone</translation>
    </message>
    <message>
        <source>Survey a place's data</source>
        <translation>Examiner les données d’un lieu</translation>
    </message>
    <message>
        <source>Symbols clockwise from north, such as DDBL; ? where one is unknown.</source>
        <translation>Symboles à partir du nord dans le sens des aiguilles d’une montre, comme DDBL ; ? pour un symbole inconnu.</translation>
    </message>
    <message>
        <source>The city is divided into square cells. For each it is stored which street objects are seen from its centre, clockwise from north: its signature. Cells that see nothing are left out. A folder with the street objects, ready to be searched, is written next to the database.</source>
        <translation>La ville est découpée en cellules carrées. Pour chacune est enregistré quels objets de rue se voient de son centre, à partir du nord dans le sens des aiguilles d’une montre : sa signature. Les cellules qui ne voient rien sont omises. À côté de la base est écrit un dossier avec les objets de rue, prêts pour la recherche.</translation>
    </message>
    <message>
        <source>The engine did not answer.</source>
        <translation>Le moteur n’a pas répondu.</translation>
    </message>
    <message>
        <source>The engine ended.</source>
        <translation>Le moteur s’est arrêté.</translation>
    </message>
    <message>
        <source>The engine is installed: {}</source>
        <translation>Le moteur est installé : {}</translation>
    </message>
    <message>
        <source>The engine is of another version than the plugin; install it again.</source>
        <translation>Le moteur n’a pas la même version que l’extension ; réinstallez-le.</translation>
    </message>
    <message>
        <source>The engine is ready: {}</source>
        <translation>Le moteur est prêt : {}</translation>
    </message>
    <message>
        <source>The engine was removed.</source>
        <translation>Le moteur a été supprimé.</translation>
    </message>
    <message>
        <source>The extent to download; by default the extent of the canvas.</source>
        <translation>L’emprise à télécharger ; par défaut l’emprise de la carte.</translation>
    </message>
    <message>
        <source>The layers, in a GeoPackage.</source>
        <translation>Les couches, dans un GeoPackage.</translation>
    </message>
    <message>
        <source>The places that a view from here may be confused with, by chance:</source>
        <translation>Les lieux avec lesquels une vue d’ici peut être confondue, par probabilité :</translation>
    </message>
    <message>
        <source>The semsig command (leave empty to look for it)</source>
        <translation>La commande semsig (laisser vide pour la chercher)</translation>
    </message>
    <message>
        <source>The tools need an engine: the program semsig in a Python environment of its own, in the folder of your QGIS profile. It takes about 1 GB; nothing else on this computer is changed.</source>
        <translation>Les outils ont besoin d’un moteur : le programme semsig dans son propre environnement Python, dans le dossier de votre profil QGIS. Il occupe environ 1 Go ; rien d’autre n’est modifié sur cet ordinateur.</translation>
    </message>
    <message>
        <source>The view fits the best place badly: worse than {worse} of 1,000 simulated views from there.</source>
        <translation>La vue correspond mal au meilleur lieu : moins bien que {worse} vues simulées de là sur 1 000.</translation>
    </message>
    <message>
        <source>The view may not be from this area: chance {chance}.</source>
        <translation>La vue n’est peut-être pas de cette zone : probabilité {chance}.</translation>
    </message>
    <message>
        <source>The view may not be from this area: chance {chance}; it fits the best place worse than {worse} of 1,000 simulated views from there.</source>
        <translation>La vue n’est peut-être pas de cette zone : probabilité {chance} ; elle correspond au meilleur lieu moins bien que {worse} vues simulées de là sur 1 000.</translation>
    </message>
    <message>
        <source>This is what is seen from there; change it, or find the place.</source>
        <translation>Voici ce que l’on voit de là ; modifiez-le ou trouvez le lieu.</translation>
    </message>
    <message>
        <source>Threads</source>
        <translation>Fils d’exécution</translation>
    </message>
    <message>
        <source>Tile size</source>
        <translation>Taille des tuiles</translation>
    </message>
    <message>
        <source>Tile size; 2000 with --workers or --scheduler.</source>
        <translation>Taille des tuiles ; 2000 avec --workers ou --scheduler.</translation>
    </message>
    <message>
        <source>Time between the objects</source>
        <translation>Temps entre les objets</translation>
    </message>
    <message>
        <source>Time limit</source>
        <translation>Limite de temps</translation>
    </message>
    <message>
        <source>Title</source>
        <translation>Titre</translation>
    </message>
    <message>
        <source>Total chance of the regions of --out.</source>
        <translation>Probabilité totale des régions de --out.</translation>
    </message>
    <message>
        <source>Turn the boxes of an object detector into views for semsig localize.</source>
        <translation>Transforme les cadres d’un détecteur d’objets en vues pour semsig localize.</translation>
    </message>
    <message>
        <source>Types</source>
        <translation>Types</translation>
    </message>
    <message>
        <source>Update signature database</source>
        <translation>Mettre à jour la base de signatures</translation>
    </message>
    <message>
        <source>Updated database</source>
        <translation>Base mise à jour</translation>
    </message>
    <message>
        <source>Use at most this many views a set.</source>
        <translation>Utiliser au plus ce nombre de vues par ensemble.</translation>
    </message>
    <message>
        <source>Use the buildings and streets that `semsig load` wrote next to the street objects.</source>
        <translation>Utiliser les bâtiments et les rues que `semsig load` a écrits à côté des objets de rue.</translation>
    </message>
    <message>
        <source>Use the cache only.</source>
        <translation>N’utiliser que le cache.</translation>
    </message>
    <message>
        <source>Vector file, or folder of files, to draft for.</source>
        <translation>Fichier vectoriel, ou dossier de fichiers, pour l’ébauche.</translation>
    </message>
    <message>
        <source>Viewpoints</source>
        <translation>Points de vue</translation>
    </message>
    <message>
        <source>Viewpoints: every cell, outdoor cells or cells near streets.</source>
        <translation>Points de vue : chaque cellule (all), les cellules en extérieur (outdoor) ou les cellules près des rues (streets).</translation>
    </message>
    <message>
        <source>Views</source>
        <translation>Vues</translation>
    </message>
    <message>
        <source>Views from detections</source>
        <translation>Vues à partir de détections</translation>
    </message>
    <message>
        <source>Views in their order: a CSV or JSON lines file, or - for JSON lines from standard input. Each after the first has the step from the previous view, dx,dy or distance,bearing (metres, degrees), and its sigma; or use --track.</source>
        <translation>Vues dans leur ordre : un fichier CSV ou JSON par lignes, ou - pour du JSON par lignes sur l’entrée standard. Chacune après la première a le pas depuis la vue précédente, dx,dy ou distance,bearing (mètres, degrés), et son sigma ; ou utilisez --track.</translation>
    </message>
    <message>
        <source>Views of one camera and detector at unknown places, instead of --samples: a CSV or JSON lines file, as of semsig localize --queries.</source>
        <translation>Vues d’une caméra et d’un détecteur de lieux inconnus, au lieu de --samples : un fichier CSV ou JSON par lignes, comme pour semsig localize --queries.</translation>
    </message>
    <message>
        <source>Views of unknown places</source>
        <translation>Vues de lieux inconnus</translation>
    </message>
    <message>
        <source>Views to write (.jsonl), for --queries.</source>
        <translation>Vues à écrire (.jsonl), pour --queries.</translation>
    </message>
    <message>
        <source>Visibility range</source>
        <translation>Portée de visibilité</translation>
    </message>
    <message>
        <source>Visibility range for classes without a range in the catalogue.</source>
        <translation>Portée de visibilité des classes pour lesquelles le catalogue n’en donne pas.</translation>
    </message>
    <message>
        <source>Visibility range.</source>
        <translation>Portée de visibilité.</translation>
    </message>
    <message>
        <source>What was seen</source>
        <translation>Ce qui a été vu</translation>
    </message>
    <message>
        <source>What was seen, such as 'bench at 40, two trees NE, no hydrant' or 'bench left, lamp behind near'; or letters of classes clockwise from north, such as DDBL.</source>
        <translation>Ce qui a été vu, comme 'banc à 40, deux arbres NE, pas de bouche d’incendie' ou 'banc à gauche, lampadaire derrière moi' ; ou les lettres des classes à partir du nord dans le sens des aiguilles d’une montre, comme DDBL.</translation>
    </message>
    <message>
        <source>Whether north is known: known, unknown, or its standard deviation in degrees, 0.001 to 360.</source>
        <translation>Si le nord est connu : known (connu), unknown (inconnu), ou son écart type en degrés, de 0.001 à 360.</translation>
    </message>
    <message>
        <source>Without a network</source>
        <translation>Sans réseau</translation>
    </message>
    <message>
        <source>Write a page with curves, a map and the worst failures (.html).</source>
        <translation>Écrire une page avec des courbes, une carte et les pires échecs (.html).</translation>
    </message>
    <message>
        <source>Write a title on the map, such as the city and the date of its data.</source>
        <translation>Écrire un titre sur la carte, comme la ville et la date de ses données.</translation>
    </message>
    <message>
        <source>Write hexagons of this resolution of H3, such as 9, that sum up cells, objects and queries.</source>
        <translation>Écrire des hexagones de cette résolution de H3, comme 9, qui résument cellules, objets et requêtes.</translation>
    </message>
    <message>
        <source>Write the buildings and streets of the source as well, next to --out.</source>
        <translation>Écrire aussi les bâtiments et les rues de la source, à côté de --out.</translation>
    </message>
    <message>
        <source>Years between the old objects and the new ones, for the report of --json.</source>
        <translation>Années entre les anciens objets et les nouveaux, pour le rapport de --json.</translation>
    </message>
    <message>
        <source>a made-up Paris</source>
        <translation>un Paris inventé</translation>
    </message>
    <message>
        <source>all built-in maps</source>
        <translation>toutes celles qui sont intégrées</translation>
    </message>
    <message>
        <source>all processors</source>
        <translation>tous les processeurs</translation>
    </message>
    <message>
        <source>all processors, 0 for --size small</source>
        <translation>tous les processeurs, 0 pour --size small</translation>
    </message>
    <message>
        <source>as a polygon, in CSV as a point</source>
        <translation>un polygone, en CSV un point</translation>
    </message>
    <message>
        <source>as many cells as Paris</source>
        <translation>autant de cellules que Paris</translation>
    </message>
    <message>
        <source>box where a file states one</source>
        <translation>box, là où un fichier en indique une</translation>
    </message>
    <message>
        <source>by-hand for a view in words, photo for a view of sectors, panorama for a full turn with scores, otherwise generic</source>
        <translation>by-hand pour une vue en mots, photo pour une vue par secteurs, panorama pour un tour complet avec des scores, sinon generic</translation>
    </message>
    <message>
        <source>downloaded</source>
        <translation>téléchargé</translation>
    </message>
    <message>
        <source>extent</source>
        <translation>emprise</translation>
    </message>
    <message>
        <source>file</source>
        <translation>fichier</translation>
    </message>
    <message>
        <source>from EXIF</source>
        <translation>d’EXIF</translation>
    </message>
    <message>
        <source>from EXIF; 360 for a panorama</source>
        <translation>d’EXIF ; 360 pour un panorama</translation>
    </message>
    <message>
        <source>from a chance of 0.9</source>
        <translation>à partir d’une probabilité de 0,9</translation>
    </message>
    <message>
        <source>from the database</source>
        <translation>de la base</translation>
    </message>
    <message>
        <source>full turn</source>
        <translation>tour complet</translation>
    </message>
    <message>
        <source>in place</source>
        <translation>sur place</translation>
    </message>
    <message>
        <source>learn it</source>
        <translation>il est appris</translation>
    </message>
    <message>
        <source>likelihood</source>
        <translation>likelihood</translation>
    </message>
    <message>
        <source>looked for</source>
        <translation>recherché</translation>
    </message>
    <message>
        <source>m</source>
        <translation>m</translation>
    </message>
    <message>
        <source>name</source>
        <translation>nom</translation>
    </message>
    <message>
        <source>next to the street objects, if there are any</source>
        <translation>à côté des objets de rue, s’il y en a</translation>
    </message>
    <message>
        <source>outdoor where there are buildings, otherwise all</source>
        <translation>outdoor là où il y a des bâtiments, sinon all</translation>
    </message>
    <message>
        <source>over 99 %</source>
        <translation>plus de 99 %</translation>
    </message>
    <message>
        <source>pinhole</source>
        <translation>pinhole (sténopé)</translation>
    </message>
    <message>
        <source>polygons</source>
        <translation>polygones</translation>
    </message>
    <message>
        <source>s</source>
        <translation>s</translation>
    </message>
    <message>
        <source>semsig's own</source>
        <translation>celui de semsig</translation>
    </message>
    <message>
        <source>that of --size</source>
        <translation>celui de --size</translation>
    </message>
    <message>
        <source>that of Monaco in OpenStreetMap</source>
        <translation>celui de Monaco dans OpenStreetMap</translation>
    </message>
    <message>
        <source>the catalogue's or the UTM zone</source>
        <translation>celui du catalogue, ou la zone UTM</translation>
    </message>
    <message>
        <source>the classes of all built-in catalogues</source>
        <translation>les classes de tous les catalogues intégrés</translation>
    </message>
    <message>
        <source>the folder of the files, or the one of images next to it</source>
        <translation>le dossier des fichiers, ou celui des images à côté</translation>
    </message>
    <message>
        <source>the name of --out with .buildings</source>
        <translation>le nom de --out avec .buildings</translation>
    </message>
    <message>
        <source>the name of --out with .streets</source>
        <translation>le nom de --out avec .streets</translation>
    </message>
    <message>
        <source>the name of the database's file</source>
        <translation>le nom du fichier de la base</translation>
    </message>
    <message>
        <source>the store of the database</source>
        <translation>le magasin de la base</translation>
    </message>
    <message>
        <source>today</source>
        <translation>aujourd’hui</translation>
    </message>
    <message>
        <source>under 1 %</source>
        <translation>moins de 1 %</translation>
    </message>
    <message>
        <source>uniform</source>
        <translation>uniform (uniforme)</translation>
    </message>
    <message>
        <source>where there are street objects and bearings</source>
        <translation>là où il y a des objets de rue et des azimuts</translation>
    </message>
    <message>
        <source>years</source>
        <translation>ans</translation>
    </message>
    <message>
        <source>{name}: {cells} cells. Click a cell, or compose what you see.</source>
        <translation>{name} : {cells} cellules. Cliquez une cellule, ou composez ce que vous voyez.</translation>
    </message>
    <message>
        <source>{title}: {part}</source>
        <translation>{title} : {part}</translation>
    </message>
    <message>
        <source>°</source>
        <translation>°</translation>
    </message>
    <message>
        <source>“{}”</source>
        <translation>« {} »</translation>
    </message>
</context>
</TS>
