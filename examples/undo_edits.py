"""Edit a project, undo, and redo: a project is a value, so no edit loses a motion."""

from enliven import History, PlaneCut, Recording, copy, cut, load_sample, possess, read_project, write_project
from enliven.possession import ActorSettings
from enliven_edge.assets import CHAIR

performer = [frame.bodies[0] for frame in Recording(CHAIR).truth()][60:90]
project, chair = possess(load_sample("chair"), performer, settings=ActorSettings())

history = History(project)
halves, (lower, upper) = cut(project, chair, PlaneCut(point=[0, 0.9, 0], normal=[0, 1, 0]), time=0.5)
history.record_edit("Cut the chair", halves)
twice, _ = copy(halves, upper, offset=[1.0, 0.0, 0.0])
history.record_edit("Copy its back", twice)
print("steps:", history.names)
print("before:", *project.characters, "| after:", *twice.characters, "| undone:", *history.undo().characters)

write_project("undo_edits.enliven", history.redo())
print("read again:", *read_project("undo_edits.enliven").characters)
