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
        <source>A cell is drawn as</source>
        <translation>Une cellule est dessinée comme</translation>
    </message>
    <message>
        <source>A cell must see</source>
        <translation>Une cellule doit voir</translation>
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
        <source>Answer</source>
        <translation>Réponse</translation>
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
        <source>Cancelled; what was there before is as it was.</source>
        <translation>Annulé ; ce qui était là est resté tel quel.</translation>
    </message>
    <message>
        <source>Candidates</source>
        <translation>Candidats</translation>
    </message>
    <message>
        <source>Cannot tell: within {metres} m of the best place with a chance of {chance}.</source>
        <translation>Impossible à dire : à moins de {metres} m du meilleur lieu avec une probabilité de {chance}.</translation>
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
        <source>Cell {cell} sees {types}; {alike} other cells see the same types.</source>
        <translation>La cellule {cell} voit {types} ; {alike} autres cellules voient les mêmes types.</translation>
    </message>
    <message>
        <source>Cells</source>
        <translation>Cellules</translation>
    </message>
    <message>
        <source>Chance</source>
        <translation>Probabilité</translation>
    </message>
    <message>
        <source>Chance that the regions hold</source>
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
        <source>Choose what you see, and click its direction in the wheel. A click takes it away.</source>
        <translation>Choisissez ce que vous voyez, puis cliquez sa direction dans la roue. Un clic dessus l’enlève.</translation>
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
        <source>Distortion</source>
        <translation>Distorsion</translation>
    </message>
    <message>
        <source>Download OpenStreetMap for this canvas</source>
        <translation>Télécharger OpenStreetMap pour cette carte</translation>
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
        <source>Looking for Python...</source>
        <translation>Recherche de Python…</translation>
    </message>
    <message>
        <source>Map page</source>
        <translation>Page de carte</translation>
    </message>
    <message>
        <source>Method</source>
        <translation>Méthode</translation>
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
        <source>Shows what is seen from a cell, and the cells most like it.</source>
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
        <source>Suggest a catalogue</source>
        <translation>Proposer un catalogue</translation>
    </message>
    <message>
        <source>The cells that a view from here would be taken for, by chance:</source>
        <translation>Les cellules pour lesquelles une vue d’ici serait prise, par probabilité :</translation>
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
        <source>The semsig command (leave empty to look for it)</source>
        <translation>La commande semsig (laisser vide pour la chercher)</translation>
    </message>
    <message>
        <source>The tools need an engine: the program semsig in a Python environment of its own, in the folder of your QGIS profile. It takes about 1.2 GB; nothing else on this computer is changed.</source>
        <translation>Les outils ont besoin d’un moteur : le programme semsig dans son propre environnement Python, dans le dossier de votre profil QGIS. Il occupe environ 1,2 Go ; rien d’autre n’est modifié sur cet ordinateur.</translation>
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
        <source>Viewpoints</source>
        <translation>Points de vue</translation>
    </message>
    <message>
        <source>Visibility range (m)</source>
        <translation>Portée de visibilité (m)</translation>
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
