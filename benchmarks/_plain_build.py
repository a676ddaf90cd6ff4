"""What sees what in a city with buildings, by geopandas, scipy and shapely, as a script.

Its arguments are the files of street objects and buildings, and the file to write.
"""

import sys

import geopandas as gpd
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import shapely
from scipy.spatial import cKDTree

STEP_M, RANGE_M = 10.0, 30.0

objects = gpd.read_parquet(sys.argv[1])
houses = gpd.read_file(sys.argv[2]).to_crs(objects.crs).geometry.make_valid().to_numpy()
xy = shapely.get_coordinates(objects.geometry.to_numpy())
reach = np.arange(-RANGE_M, RANGE_M + STEP_M, STEP_M)
around = np.stack(np.meshgrid(reach, reach), axis=-1).reshape(-1, 2)
cells = np.unique(np.floor(xy / STEP_M).astype(np.int64), axis=0)
near = cells[:, None] + (around / STEP_M).astype(np.int64)
places = (np.unique(near.reshape(-1, 2), axis=0) + 0.5) * STEP_M
tree = shapely.STRtree(houses)
indoor = np.unique(tree.query(shapely.points(places), predicate="intersects")[0])
places = np.delete(places, indoor, axis=0)
pairs = cKDTree(places).sparse_distance_matrix(cKDTree(xy), RANGE_M, output_type="ndarray")
place, thing = pairs["i"], pairs["j"]
lines = np.asarray(shapely.linestrings(np.stack([places[place], xy[thing]], axis=1)))
is_seen = np.ones(len(lines), bool)
is_seen[tree.query(lines, predicate="intersects")[0]] = False
place, thing, distance = place[is_seen], thing[is_seen], pairs["v"][is_seen]
east, north = (xy[thing] - places[place]).T
bearing = np.degrees(np.arctan2(east, north)) % 360.0
order = np.lexsort((bearing, place))
columns = {"place": place, "thing": thing, "bearing": bearing, "distance": distance}
pq.write_table(pa.table({name: column[order] for name, column in columns.items()}), sys.argv[3])
