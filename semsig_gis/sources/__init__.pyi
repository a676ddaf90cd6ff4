from .files import (
    MERGING as MERGING,
)
from .files import (
    PRUNING as PRUNING,
)
from .files import (
    READERS as READERS,
)
from .files import (
    TAGS_READER as TAGS_READER,
)
from .files import (
    file_reader as file_reader,
)
from .files import (
    find_files as find_files,
)
from .files import (
    reader as reader,
)
from .layer import RawLayer as RawLayer
from .layer import Reader as Reader
from .layer import RowCounts as RowCounts
from .paths import FILE_SUFFIXES as FILE_SUFFIXES
from .paths import files_in as files_in
from .paths import require_file as require_file
