from .contacts import (
    Contacts as Contacts,
    find_contacts as find_contacts,
    hold as hold,
    find_runs as find_runs,
    touching as touching,
)
from .pin import (
    HeldPin as HeldPin,
    find_bend as find_bend,
    resolve_pins as resolve_pins,
    local_turns as local_turns,
    pin_feet as pin_feet,
    pin_limb as pin_limb,
    rebuild as rebuild,
    unpin as unpin,
)
from .foot_lock import (
    FootLock as FootLock,
    compute_foot_lock as compute_foot_lock,
    find_analysis_window as find_analysis_window,
)
