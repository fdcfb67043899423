from .lazy import LazyCommands as LazyCommands
from .part_names import check_parts as check_parts
from .processes import (
    parent_is_gone as parent_is_gone,
    start_process as start_process,
    terminate_as_interrupt as terminate_as_interrupt,
)
from .run import has_display as has_display
from .terminal import (
    facts_table as facts_table,
    plain_console as plain_console,
    plain_text as plain_text,
    progress_lines as progress_lines,
    say as say,
)
