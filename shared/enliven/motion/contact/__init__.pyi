from .contacts import (
    Contacts as Contacts,
    contacts_of as contacts_of,
    hold as hold,
    runs_of as runs_of,
    touching as touching,
)
from .pin import (
    HeldPin as HeldPin,
    bend_of as bend_of,
    held_pins as held_pins,
    local_turns as local_turns,
    pin_feet as pin_feet,
    pin_limb as pin_limb,
    rebuild as rebuild,
    unpin as unpin,
)
from .foot_lock import FootLock as FootLock, foot_lock_of as foot_lock_of, window_of as window_of
