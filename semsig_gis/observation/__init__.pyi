# What other packages may import from here: name and module, read by `__init__.py`.

from .detectors.camera import Camera as Camera
from .detectors.camera import Projection as Projection
from .detectors.exif import picture_shot as picture_shot
from .detectors.exif import read_exif as read_exif
from .detectors.formats import read_pictures as read_pictures
from .detectors.labels import LabelMap as LabelMap
from .detectors.labels import Meaning as Meaning
from .detectors.labels import label_maps as label_maps
from .detectors.pictures import Box as Box
from .detectors.pictures import Picture as Picture
from .detectors.pictures import Shot as Shot
from .detectors.views import (
    DEGREE_DIGITS as DEGREE_DIGITS,
)
from .detectors.views import (
    ERROR_DIGITS as ERROR_DIGITS,
)
from .detectors.views import (
    METRE_DIGITS as METRE_DIGITS,
)
from .detectors.views import (
    Detector as Detector,
)
from .detectors.views import (
    Tally as Tally,
)
from .detectors.views import (
    field_of_view as field_of_view,
)
from .detectors.views import (
    north_sigma as north_sigma,
)
from .detectors.views import (
    placed as placed,
)
from .detectors.views import (
    read_shots as read_shots,
)
from .detectors.views import (
    with_heights as with_heights,
)
from .files import (
    QueryLine as QueryLine,
)
from .files import (
    Route as Route,
)
from .files import (
    parse_queries as parse_queries,
)
from .files import (
    parse_route as parse_route,
)
from .files import (
    read_queries as read_queries,
)
from .files import (
    read_route as read_route,
)
from .leg import Leg as Leg
from .north import GRID_NORTH as GRID_NORTH
from .north import North as North
from .north import declination as declination
from .sentences import (
    GUESS_ERROR as GUESS_ERROR,
)
from .sentences import (
    RADIUS_M as RADIUS_M,
)
from .sentences import (
    SEEN as SEEN,
)
from .sentences import (
    parse_view as parse_view,
)
from .sentences import (
    said_row as said_row,
)
from .sentences import (
    unplaced_codes as unplaced_codes,
)
from .sentences import (
    unplaced_parts as unplaced_parts,
)
from .track import read_track as read_track
from .view import (
    CLASSES as CLASSES,
)
from .view import (
    FULL_VIEW as FULL_VIEW,
)
from .view import (
    LEAST_TURN as LEAST_TURN,
)
from .view import (
    Photo as Photo,
)
from .view import (
    Sector as Sector,
)
from .view import (
    View as View,
)
from .view import (
    check_north as check_north,
)
