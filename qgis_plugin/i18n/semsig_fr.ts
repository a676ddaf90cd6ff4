<?xml version="1.0" encoding="utf-8"?>
<!DOCTYPE TS>
<TS version="2.1" language="fr" sourcelanguage="en">
<context>
    <name>Semsig</name>
    <message>
        <source>1. Load street objects</source>
        <translation>1. Charger les objets de rue</translation>
    </message>
    <message>
        <source>2. Build signature database</source>
        <translation>2. Construire la base de signatures</translation>
    </message>
    <message>
        <source>3. Localize a query</source>
        <translation>3. Localiser une requête</translation>
    </message>
    <message>
        <source>4. Evaluate</source>
        <translation>4. Évaluer</translation>
    </message>
    <message>
        <source>5. Where queries can be placed</source>
        <translation>5. Où les requêtes peuvent être situées</translation>
    </message>
    <message>
        <source>6. Export cells</source>
        <translation>6. Exporter les cellules</translation>
    </message>
    <message>
        <source>A CRS in metres; by default that of the catalogue, or the UTM zone.</source>
        <translation>Un SCR en mètres ; par défaut celui du catalogue, ou la zone UTM.</translation>
    </message>
    <message>
        <source>A GeoTIFF: for each cell, the number of cells that look the same.</source>
        <translation>Un GeoTIFF : pour chaque cellule, le nombre de cellules de même aspect.</translation>
    </message>
    <message>
        <source>A catalogue file, in addition to the catalogues chosen above or instead of them.</source>
        <translation>Un fichier de catalogue, en plus de ceux choisis ci-dessus ou à leur place.</translation>
    </message>
    <message>
        <source>A catalogue says which file holds what: the open data of Montpellier and of Paris, and OpenStreetMap, are built in; for other data, write one (“Suggest a catalogue” drafts it).</source>
        <translation>Un catalogue dit quel fichier contient quoi : les données ouvertes de Montpellier et de Paris, et OpenStreetMap, sont intégrés ; pour d’autres données, écrivez-en un (« Proposer un catalogue » l’esquisse).</translation>
    </message>
    <message>
        <source>A cell is drawn as</source>
        <translation>Une cellule est dessinée comme</translation>
    </message>
    <message>
        <source>A cell must see</source>
        <translation>Une cellule doit voir</translation>
    </message>
    <message>
        <source>A folder in which the catalogue's files are looked for, instead of files.</source>
        <translation>Un dossier où sont cherchés les fichiers du catalogue, au lieu de fichiers.</translation>
    </message>
    <message>
        <source>A large city takes minutes. Results that exist are not computed again.</source>
        <translation>Une grande ville prend des minutes. Les résultats existants ne sont pas recalculés.</translation>
    </message>
    <message>
        <source>A page for the browser with the chances and the candidates.</source>
        <translation>Une page pour le navigateur avec les probabilités et les candidats.</translation>
    </message>
    <message>
        <source>A page for the browser, on which cells can be clicked.</source>
        <translation>Une page pour le navigateur, où l’on peut cliquer sur les cellules.</translation>
    </message>
    <message>
        <source>A page for the browser: successful and failed queries, and where they fail.</source>
        <translation>Une page pour le navigateur : requêtes réussies et manquées, et où elles échouent.</translation>
    </message>
    <message>
        <source>A query counts as found if its best place is at most this far from the true place.</source>
        <translation>Une requête compte comme trouvée si son meilleur lieu est à cette distance au plus du vrai.</translation>
    </message>
    <message>
        <source>A query counts as right if one of this many candidates is right.</source>
        <translation>Une requête est juste si l’un de ces premiers candidats est juste.</translation>
    </message>
    <message>
        <source>A vector file of any format.</source>
        <translation>Un fichier vecteur de n’importe quel format.</translation>
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
        <source>Another number draws other queries.</source>
        <translation>Un autre nombre tire d’autres requêtes.</translation>
    </message>
    <message>
        <source>Another number makes another city.</source>
        <translation>Un autre nombre donne une autre ville.</translation>
    </message>
    <message>
        <source>Another number simulates other queries.</source>
        <translation>Un autre nombre simule d’autres requêtes.</translation>
    </message>
    <message>
        <source>Answer</source>
        <translation>Réponse</translation>
    </message>
    <message>
        <source>Applies new street objects to a database: only the cells that see a change are computed again. The layers of the new objects replace the same layers of the database.</source>
        <translation>Applique de nouveaux objets de rue à une base : seules les cellules qui voient un changement sont recalculées. Les couches des nouveaux objets remplacent celles de la base.</translation>
    </message>
    <message>
        <source>Area</source>
        <translation>Zone</translation>
    </message>
    <message>
        <source>Around the regions (m)</source>
        <translation>Autour des régions (m)</translation>
    </message>
    <message>
        <source>Bearings (°)</source>
        <translation>Azimuts (°)</translation>
    </message>
    <message>
        <source>Best candidates that count</source>
        <translation>Meilleurs candidats qui comptent</translation>
    </message>
    <message>
        <source>Building footprints to write too, where the files have some. “Build signature database” hides what is behind them.</source>
        <translation>Les emprises de bâtiments à écrire aussi, si les fichiers en ont. « Construire la base de signatures » cache ce qui est derrière.</translation>
    </message>
    <message>
        <source>Building footprints to write too. “Build signature database” hides what is behind them.</source>
        <translation>Les emprises de bâtiments à écrire aussi. « Construire la base de signatures » cache ce qui est derrière.</translation>
    </message>
    <message>
        <source>Building footprints; objects behind them are not seen.</source>
        <translation>Emprises de bâtiments ; les objets derrière elles ne se voient pas.</translation>
    </message>
    <message>
        <source>Buildings</source>
        <translation>Bâtiments</translation>
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
        <source>Cannot tell: 90 % of the chance is in {cells} cells, and {chance} within {metres} m of the best place.</source>
        <translation>Impossible à dire : 90 % de la probabilité est dans {cells} cellules, et {chance} à moins de {metres} m du meilleur lieu.</translation>
    </message>
    <message>
        <source>Catalogue</source>
        <translation>Catalogue</translation>
    </message>
    <message>
        <source>Catalogue of your own</source>
        <translation>Votre propre catalogue</translation>
    </message>
    <message>
        <source>Catalogues</source>
        <translation>Catalogues</translation>
    </message>
    <message>
        <source>Cell {cell} sees {types}; {count} other cells see the same types.</source>
        <translation>La cellule {cell} voit {types} ; {count} autres cellules voient les mêmes types.</translation>
    </message>
    <message>
        <source>Cells</source>
        <translation>Cellules</translation>
    </message>
    <message>
        <source>Cells that see nothing are left out. A folder with the street objects, ready to be searched, is written next to the database; keep it there.</source>
        <translation>Les cellules qui ne voient rien sont omises. À côté de la base apparaît un dossier avec les objets de rue ; laissez-le là.</translation>
    </message>
    <message>
        <source>Centre lines of streets to write too, where the files have some.</source>
        <translation>Les lignes médianes des rues à écrire aussi, si les fichiers en ont.</translation>
    </message>
    <message>
        <source>Centre lines of streets to write too.</source>
        <translation>Les lignes médianes des rues à écrire aussi.</translation>
    </message>
    <message>
        <source>Centre lines, for the viewpoints along streets.</source>
        <translation>Lignes médianes, pour les points de vue le long des rues.</translation>
    </message>
    <message>
        <source>Chance</source>
        <translation>Probabilité</translation>
    </message>
    <message>
        <source>Chance that the regions contain</source>
        <translation>Probabilité contenue dans les régions</translation>
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
        <source>Choose what you see, and click its direction in the dial. Click an object to remove it.</source>
        <translation>Choisissez ce que vous voyez, puis cliquez sa direction dans le cadran. Un clic sur un objet l’enlève.</translation>
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
        <source>Composes the view that is seen from a place of the map.</source>
        <translation>Compose la vue que l’on a d’un lieu de la carte.</translation>
    </message>
    <message>
        <source>Demo city</source>
        <translation>Ville de démonstration</translation>
    </message>
    <message>
        <source>Detector</source>
        <translation>Détecteur</translation>
    </message>
    <message>
        <source>Distance around their cells that is searched as well.</source>
        <translation>Distance autour de leurs cellules où l’on cherche aussi.</translation>
    </message>
    <message>
        <source>Distortion</source>
        <translation>Distorsion</translation>
    </message>
    <message>
        <source>Divides the city into square cells and stores for each which street objects are seen from its centre, clockwise from north: its signature. Queries are compared with these signatures.</source>
        <translation>Découpe la ville en cellules carrées et enregistre pour chacune quels objets de rue se voient de son centre, à partir du nord dans le sens des aiguilles d’une montre : sa signature. Les requêtes sont comparées à ces signatures.</translation>
    </message>
    <message>
        <source>Download OpenStreetMap for this canvas</source>
        <translation>Télécharger OpenStreetMap pour cette carte</translation>
    </message>
    <message>
        <source>Downloads the street objects of OpenStreetMap (trees, lamps, benches, stops...) in a part of the map, from an Overpass server, into a table that “Build signature database” takes.</source>
        <translation>Télécharge les objets de rue d’OpenStreetMap (arbres, lampadaires, bancs, arrêts…) d’une partie de la carte, depuis un serveur Overpass, dans une table pour « Construire la base de signatures ».</translation>
    </message>
    <message>
        <source>Downloads the street objects of a city: by its name, or in the polygons of a layer. A catalogue says from where: OpenStreetMap has every place; a city's own portal has more of that city.</source>
        <translation>Télécharge les objets de rue d’une ville : par son nom, ou dans les polygones d’une couche. Un catalogue dit d’où : OpenStreetMap a tous les lieux ; le portail d’une ville en sait plus sur elle.</translation>
    </message>
    <message>
        <source>Drafts a catalogue for a file of your own: which column contains the kind of an object, and which class of street objects each of its values may be. Check and correct the draft in a text editor, and give it to “Load street objects” as a catalogue of your own.</source>
        <translation>Esquisse un catalogue pour un fichier à vous : quelle colonne contient le genre d’un objet, et quelle classe d’objets de rue chacune de ses valeurs peut être. Relisez et corrigez l’esquisse dans un éditeur de texte, et donnez-la à « Charger les objets de rue » comme votre propre catalogue.</translation>
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
        <source>Every cell, outdoor cells, or outdoor cells near streets.</source>
        <translation>Toutes les cellules, les cellules hors des bâtiments, ou les cellules près des rues et hors des bâtiments.</translation>
    </message>
    <message>
        <source>Explore a city</source>
        <translation>Explorer une ville</translation>
    </message>
    <message>
        <source>Extent</source>
        <translation>Emprise</translation>
    </message>
    <message>
        <source>Fetch a city</source>
        <translation>Télécharger une ville</translation>
    </message>
    <message>
        <source>File</source>
        <translation>Fichier</translation>
    </message>
    <message>
        <source>Files</source>
        <translation>Fichiers</translation>
    </message>
    <message>
        <source>Find the place</source>
        <translation>Trouver le lieu</translation>
    </message>
    <message>
        <source>Finds where in the city a view was taken from: what is seen, clockwise from north, is compared with the signature of every cell. Types without bearings, or bearings without types, are enough.</source>
        <translation>Trouve d’où dans la ville une vue a été prise : ce qui se voit, à partir du nord dans le sens des aiguilles d’une montre, est comparé à la signature de chaque cellule. Des types sans azimuts ou des azimuts sans types suffisent.</translation>
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
        <source>Folder of wheels</source>
        <translation>Dossier de wheels</translation>
    </message>
    <message>
        <source>Folder of wheels (leave empty to download them)</source>
        <translation>Dossier de wheels (laisser vide pour les télécharger)</translation>
    </message>
    <message>
        <source>Folder to write to.</source>
        <translation>Le dossier où écrire.</translation>
    </message>
    <message>
        <source>For files that do not state theirs.</source>
        <translation>Pour les fichiers qui n’indiquent pas le leur.</translation>
    </message>
    <message>
        <source>Found within (m)</source>
        <translation>Trouvé à moins de (m)</translation>
    </message>
    <message>
        <source>Found: the place is within {metres} m with a chance of {chance}.</source>
        <translation>Trouvé : le lieu est à moins de {metres} m avec une probabilité de {chance}.</translation>
    </message>
    <message>
        <source>From the true to the best place</source>
        <translation>Du vrai lieu au meilleur</translation>
    </message>
    <message>
        <source>Further distortions</source>
        <translation>Autres distorsions</translation>
    </message>
    <message>
        <source>Help</source>
        <translation>Aide</translation>
    </message>
    <message>
        <source>How cells are compared with a query. likelihood: by the chance that a detector sees the query from there. edit+edit: by the number of objects to add, remove or exchange to change one sequence into the other, the mean of types and angles. edit+edit:5%: the same, among the 5 % of the cells with the best types. histogram+histogram: by how often each type and each angle occurs, in any order. jaccard+jaccard: by which types and which angles occur at all. types:edit and angles:edit: as edit+edit, by only the types or only the angles.</source>
        <translation>Comment les cellules sont comparées à une requête. likelihood : par la probabilité qu’un détecteur voie la requête de là. edit+edit : par le nombre d’objets à ajouter, à ôter ou à échanger pour changer une suite en l’autre, en moyenne des types et des angles. edit+edit:5% : de même, parmi les 5 % des cellules dont les types correspondent le mieux. histogram+histogram : par le nombre de fois que chaque type et chaque angle apparaît, quel que soit l’ordre. jaccard+jaccard : par les types et les angles qui apparaissent. types:edit et angles:edit : comme edit+edit, par les types ou les angles seuls.</translation>
    </message>
    <message>
        <source>How many places (with likelihood) or cells to list at most.</source>
        <translation>Combien de lieux (avec likelihood) ou de cellules énumérer au plus.</translation>
    </message>
    <message>
        <source>How many objects the detector gets wrong: none, 1, 7 or 13.</source>
        <translation>Sur combien d’objets le détecteur se trompe : aucun, 1, 7 ou 13.</translation>
    </message>
    <message>
        <source>How many queries are asked.</source>
        <translation>Combien de requêtes sont posées.</translation>
    </message>
    <message>
        <source>How much of what is seen will be wrong: light, medium, strong, or generic where that is not known, by-hand for what a person notes down.</source>
        <translation>Combien de ce qui est vu sera faux : light (peu), medium (moyen), strong (beaucoup), ou generic quand on ne le sait pas ; by-hand pour ce qu’une personne note.</translation>
    </message>
    <message>
        <source>If “Where queries can be placed” was run, its results are written with the cells.</source>
        <translation>Si « Où les requêtes peuvent être situées » a été exécuté, ses résultats accompagnent les cellules.</translation>
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
        <source>Its square, or its centre.</source>
        <translation>Son carré, ou son centre.</translation>
    </message>
    <message>
        <source>Largest distance from which an object is seen, unless the catalogue gives one for its class.</source>
        <translation>Plus grande distance d’où un objet se voit, si le catalogue n’en donne pas pour sa classe.</translation>
    </message>
    <message>
        <source>Looking for Python...</source>
        <translation>Recherche de Python…</translation>
    </message>
    <message>
        <source>Makes up a small city, builds its database, evaluates queries and shows the results: to try the tools without data or a network. The folder contains city.parquet for the other tools.</source>
        <translation>Invente une petite ville, construit sa base, évalue des requêtes et montre les résultats : pour essayer, sans données ni réseau. Le dossier contient city.parquet pour les autres outils.</translation>
    </message>
    <message>
        <source>Map page</source>
        <translation>Page de carte</translation>
    </message>
    <message>
        <source>Measures how often answers are right. Cells are drawn as queries, their signatures are distorted as a bad detector would (objects missed, made up or misnamed, bearings off), and the best answer is compared with the true place.</source>
        <translation>Mesure combien de fois les réponses sont justes. Des cellules sont tirées comme requêtes, leurs signatures déformées comme par un mauvais détecteur (objets manqués, inventés ou mal nommés, azimuts faux), et la meilleure réponse est comparée au vrai lieu.</translation>
    </message>
    <message>
        <source>Method</source>
        <translation>Méthode</translation>
    </message>
    <message>
        <source>More distortions of a query, separated by commas, such as compass:10,view:90 (a compass that is off by 10°, a view of 90°).</source>
        <translation>D’autres distorsions d’une requête, séparées par des virgules, comme compass:10,view:90 (une boussole fausse de 10°, un champ de vision de 90°).</translation>
    </message>
    <message>
        <source>Name of a city or quarter, such as Gentilly, France.</source>
        <translation>Nom d’une ville ou d’un quartier, comme Gentilly, France.</translation>
    </message>
    <message>
        <source>North</source>
        <translation>Nord</translation>
    </message>
    <message>
        <source>North is off by (°)</source>
        <translation>Écart du nord (°)</translation>
    </message>
    <message>
        <source>North is unknown</source>
        <translation>Nord inconnu</translation>
    </message>
    <message>
        <source>Number of candidates</source>
        <translation>Nombre de candidats</translation>
    </message>
    <message>
        <source>Number of equal sectors in which the methods of the paper compare bearings. More sectors distinguish cells better, but tolerate smaller errors of bearings.</source>
        <translation>Nombre de secteurs égaux dans lesquels les méthodes de l’article comparent les azimuts. Plus de secteurs distinguent mieux les cellules, mais tolèrent des erreurs d’azimut plus petites.</translation>
    </message>
    <message>
        <source>Number of queries</source>
        <translation>Nombre de requêtes</translation>
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
        <source>Overpass server (leave empty for the usual ones)</source>
        <translation>Serveur Overpass (laisser vide pour les serveurs habituels)</translation>
    </message>
    <message>
        <source>Place</source>
        <translation>Lieu</translation>
    </message>
    <message>
        <source>Polygons instead of a name.</source>
        <translation>Des polygones au lieu d’un nom.</translation>
    </message>
    <message>
        <source>Polygons that the cells must lie in.</source>
        <translation>Polygones où doivent se trouver les cellules.</translation>
    </message>
    <message>
        <source>Predicts for every cell how likely a query from there will be found, and which other cells it may be confused with. A street with three lamps looks like thousands of others; this tool shows them.</source>
        <translation>Prédit pour chaque cellule avec quelle probabilité une requête faite là sera située, et avec quelles autres cellules elle peut être confondue. Une rue avec trois lampadaires ressemble à des milliers d’autres ; cet outil les montre.</translation>
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
        <source>Rank</source>
        <translation>Rang</translation>
    </message>
    <message>
        <source>Reads files of open data (trees, street lights, benches, bus stops...) into one table of street objects, which “Build signature database” takes.</source>
        <translation>Lit des fichiers de données ouvertes (arbres, lampadaires, bancs, arrêts de bus…) dans une table d’objets de rue pour « Construire la base de signatures ».</translation>
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
        <source>Seed</source>
        <translation>Graine</translation>
    </message>
    <message>
        <source>Seen from here</source>
        <translation>Vu d’ici</translation>
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
        <source>Shows how many cells see the same types in the same order: a unique cell can be identified at once, one of a thousand cannot. “Where queries can be placed” gives more detail, and takes longer.</source>
        <translation>Montre combien de cellules voient les mêmes types dans le même ordre : une cellule unique se reconnaît aussitôt, une parmi mille non. « Où les requêtes peuvent être situées » en dit plus, et prend plus de temps.</translation>
    </message>
    <message>
        <source>Shows what is seen from a cell, and the most similar cells.</source>
        <translation>Montre ce que l’on voit d’une cellule, et les cellules qui lui ressemblent le plus.</translation>
    </message>
    <message>
        <source>Side of a cell (m)</source>
        <translation>Côté d’une cellule (m)</translation>
    </message>
    <message>
        <source>Signature database</source>
        <translation>Base de signatures</translation>
    </message>
    <message>
        <source>Signature databases (*.parquet)</source>
        <translation>Bases de signatures (*.parquet)</translation>
    </message>
    <message>
        <source>Some square kilometres take seconds to minutes. What was downloaded before is taken from the cache. The server is a setting: Settings &gt; Options &gt; Processing &gt; Providers &gt; Semantic signatures.</source>
        <translation>Quelques kilomètres carrés prennent des secondes ou des minutes. Ce qui a déjà été téléchargé vient du cache. Le serveur se règle dans Préférences &gt; Options &gt; Traitement &gt; Fournisseurs &gt; Signatures sémantiques.</translation>
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
        <source>Streets</source>
        <translation>Rues</translation>
    </message>
    <message>
        <source>Such as M (a bus stop), 2B (two trees or more), B=0 (no tree), ?&lt;=10 (ten objects or fewer).</source>
        <translation>Comme M (un arrêt de bus), 2B (deux arbres ou plus), B=0 (aucun arbre), ?&lt;=10 (dix objets au plus).</translation>
    </message>
    <message>
        <source>Suggest a catalogue</source>
        <translation>Proposer un catalogue</translation>
    </message>
    <message>
        <source>Symbols of what is seen, clockwise from north, such as DDBL; ? where one is unknown. The paper's: B tree, C fountain, D street light, E indicator, G traffic light, H bike station, I public toilet, J car sharing, K taxi rank, L bench, M bus stop; a catalogue may have more.</source>
        <translation>Symboles de ce qui se voit, à partir du nord dans le sens des aiguilles d’une montre, comme DDBL ; ? pour un inconnu. Ceux de l’article : B arbre, C fontaine, D lampadaire, E indicateur, G feu de circulation, H station de vélos, I toilettes publiques, J autopartage, K station de taxis, L banc, M arrêt de bus ; un catalogue peut en avoir d’autres.</translation>
    </message>
    <message>
        <source>The GeoPackage to write.</source>
        <translation>Le GeoPackage à écrire.</translation>
    </message>
    <message>
        <source>The best places or cells.</source>
        <translation>Les meilleurs lieux ou cellules.</translation>
    </message>
    <message>
        <source>The catalogues of the files. With several, objects that two of them contain are merged; the first is treated as the best source.</source>
        <translation>Les catalogues des fichiers. S’il y en a plusieurs, les objets communs sont fusionnés ; le premier passe pour la meilleure source.</translation>
    </message>
    <message>
        <source>The cells and the street objects as layers, in a GeoPackage.</source>
        <translation>Les cellules et les objets de rue en couches, dans un GeoPackage.</translation>
    </message>
    <message>
        <source>The cells by their chance, in a GeoPackage.</source>
        <translation>Les cellules selon leur probabilité, dans un GeoPackage.</translation>
    </message>
    <message>
        <source>The places that a view from here may be confused with, by chance:</source>
        <translation>Les lieux avec lesquels une vue d’ici peut être confondue, par probabilité :</translation>
    </message>
    <message>
        <source>The database to write.</source>
        <translation>La base à écrire.</translation>
    </message>
    <message>
        <source>The database to write. A temporary file is lost when QGIS is closed.</source>
        <translation>La base à écrire. Un fichier temporaire est perdu à la fermeture de QGIS.</translation>
    </message>
    <message>
        <source>The direction of each object, in degrees clockwise from north, separated by commas, such as 10,80,200,310.</source>
        <translation>La direction de chaque objet, en degrés à partir du nord dans le sens des aiguilles d’une montre, séparées par des virgules, comme 10,80,200,310.</translation>
    </message>
    <message>
        <source>The draft to write.</source>
        <translation>L’esquisse à écrire.</translation>
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
        <source>The file that “Build signature database” wrote.</source>
        <translation>Le fichier qu’a écrit « Construire la base de signatures ».</translation>
    </message>
    <message>
        <source>The file that “Load street objects” wrote, for a second layer.</source>
        <translation>Le fichier qu’a écrit « Charger les objets de rue », pour une seconde couche.</translation>
    </message>
    <message>
        <source>The file that “Load street objects” wrote.</source>
        <translation>Le fichier qu’a écrit « Charger les objets de rue ».</translation>
    </message>
    <message>
        <source>The likelihood method gives each candidate a chance, estimates the place between the centres of cells with its uncertainty, and reports when it cannot decide. The other methods are from the paper; they rank cells by a distance, and cells that look the same share a rank.</source>
        <translation>La méthode likelihood donne à chaque candidat une probabilité, estime le lieu entre les centres des cellules avec son incertitude, et signale quand elle ne peut pas décider. Les autres méthodes sont celles de l’article ; elles classent les cellules par une distance, et les cellules de même aspect partagent un rang.</translation>
    </message>
    <message>
        <source>The log has a table of the results; the folder contains them for other programs, and the layers and the map page show them.</source>
        <translation>Le journal contient un tableau des résultats ; le dossier les contient pour d’autres programmes, les couches et la page de carte les montrent.</translation>
    </message>
    <message>
        <source>The log reports how many rows became objects, how many were left out, and why.</source>
        <translation>Le journal indique combien de lignes sont devenues des objets, combien ont été omises, et pourquoi.</translation>
    </message>
    <message>
        <source>The new objects: the file that “Load street objects” or a download wrote.</source>
        <translation>Les nouveaux objets : le fichier qu’a écrit « Charger les objets de rue » ou un téléchargement.</translation>
    </message>
    <message>
        <source>The paper of Weng, Gouet-Brunet and Soheilian uses 10 m.</source>
        <translation>L’article de Weng, Gouet-Brunet et Soheilian prend 10 m.</translation>
    </message>
    <message>
        <source>The parts of the city to search for the query, in a GeoPackage.</source>
        <translation>Les parties de la ville où chercher pour la requête, dans un GeoPackage.</translation>
    </message>
    <message>
        <source>The queries at their true places, and lines to the places that were found, in a GeoPackage.</source>
        <translation>Les requêtes à leurs vrais lieux, et des lignes vers les lieux trouvés, dans un GeoPackage.</translation>
    </message>
    <message>
        <source>The queries, their errors and a summary, for other programs.</source>
        <translation>Les requêtes, leurs erreurs et un résumé, pour d’autres programmes.</translation>
    </message>
    <message>
        <source>The results become columns of the database, and the cells are shown by their chance. The map page, which opens in a browser, shows on a click which cells a cell may be confused with.</source>
        <translation>Les résultats deviennent des colonnes de la base, et les cellules sont montrées selon leur probabilité. La page de carte, qui s’ouvre dans un navigateur, montre d’un clic avec quelles cellules une cellule peut être confondue.</translation>
    </message>
    <message>
        <source>The semsig command (leave empty to look for it)</source>
        <translation>La commande semsig (laisser vide pour la chercher)</translation>
    </message>
    <message>
        <source>The table of street objects to write. A temporary file is lost when QGIS is closed.</source>
        <translation>La table d’objets de rue à écrire. Un fichier temporaire est perdu à la fermeture de QGIS.</translation>
    </message>
    <message>
        <source>The tools need an engine: the program semsig in a Python environment of its own, in the folder of your QGIS profile. It takes about 1 GB; nothing else on this computer is changed.</source>
        <translation>Les outils ont besoin d’un moteur : le programme semsig dans son propre environnement Python, dans le dossier de votre profil QGIS. Il occupe environ 1 Go ; rien d’autre n’est modifié sur cet ordinateur.</translation>
    </message>
    <message>
        <source>This is what is seen from there; change it, or find the place.</source>
        <translation>Voici ce que l’on voit de là ; modifiez-le ou trouvez le lieu.</translation>
    </message>
    <message>
        <source>Types</source>
        <translation>Types</translation>
    </message>
    <message>
        <source>Update a signature database</source>
        <translation>Mettre à jour une base de signatures</translation>
    </message>
    <message>
        <source>Updated database</source>
        <translation>Base mise à jour</translation>
    </message>
    <message>
        <source>Vector files of any format, .osm or .osm.pbf; zipped is fine.</source>
        <translation>Fichiers vecteur de n’importe quel format, .osm ou .osm.pbf ; zippés aussi.</translation>
    </message>
    <message>
        <source>Viewpoints</source>
        <translation>Points de vue</translation>
    </message>
    <message>
        <source>Visibility range (m)</source>
        <translation>Portée de visibilité (m)</translation>
    </message>
    <message>
        <source>Where the data come from.</source>
        <translation>D’où viennent les données.</translation>
    </message>
    <message>
        <source>With likelihood and an uncertain north, the standard deviation.</source>
        <translation>Avec likelihood et un nord incertain : l’écart type.</translation>
    </message>
    <message>
        <source>With likelihood, how much of what is seen may be wrong: light, medium, strong, or generic where that is not known, by-hand for what a person noted down.</source>
        <translation>Avec likelihood : combien de ce qui est vu peut être faux : light (peu), medium (moyen), strong (beaucoup), ou generic quand on ne le sait pas ; by-hand pour ce qu’une personne a noté.</translation>
    </message>
    <message>
        <source>With likelihood, whether the north is known.</source>
        <translation>Avec likelihood : si le nord est connu.</translation>
    </message>
    <message>
        <source>With likelihood: polygons that the place lies in.</source>
        <translation>Avec likelihood : polygones où se trouve le lieu.</translation>
    </message>
    <message>
        <source>With likelihood: the ellipse in which the place lies with a chance of 90 %, if the answer is right.</source>
        <translation>Avec likelihood : l’ellipse où se trouve le lieu avec une probabilité de 90 %, si la réponse est juste.</translation>
    </message>
    <message>
        <source>With likelihood: the regions are as large as needed to contain this chance, 0.9 by default.</source>
        <translation>Avec likelihood : les régions sont aussi grandes qu’il le faut pour contenir cette probabilité, 0,9 par défaut.</translation>
    </message>
    <message>
        <source>Writes the cells of a database to a GeoPackage: what is seen from each, clockwise from north, and how many other cells look the same; with the street objects, these become a second layer.</source>
        <translation>Écrit les cellules d’une base dans un GeoPackage : ce qui se voit de chacune, à partir du nord dans le sens des aiguilles d’une montre, et combien d’autres cellules ont le même aspect ; si les objets de rue sont donnés, ils deviennent une seconde couche.</translation>
    </message>
    <message>
        <source>downloaded</source>
        <translation>téléchargé</translation>
    </message>
    <message>
        <source>looked for</source>
        <translation>recherché</translation>
    </message>
    <message>
        <source>{name}: {cells} cells. Click a cell, or compose what you see.</source>
        <translation>{name} : {cells} cellules. Cliquez une cellule, ou composez ce que vous voyez.</translation>
    </message>
</context>
</TS>
