from .by_pyogrio import LayerDescription as LayerDescription
from .file import (
    LayerInfo as LayerInfo,
)
from .file import (
    first_rows as first_rows,
)
from .file import (
    list_layers as list_layers,
)
from .file import (
    read_layer as read_layer,
)
from .file import (
    read_layers as read_layers,
)
from .file import (
    read_tables as read_tables,
)
from .file import (
    spatial_layers as spatial_layers,
)
from .member import DRIVERS as DRIVERS
from .member import Member as Member
