"""Track people in the depth images of a recording, and write one of them as a BVH file."""

from enliven import Joint, Project, Recording, clip_of_bodies, export
from enliven_edge.assets import CHAIR
from enliven_edge.tracking.tracker import Tracker
from enliven_viewer.film.project_sheet import write_project_sheet

tracker, seconds, bodies = Tracker(), [], []
for frame in Recording(CHAIR).frames():
    people = tracker.track(frame)
    if people:
        seconds.append(frame.time_ns / 1e9)
        bodies.append(people[0])
    if len(bodies) == 90:
        break

head = [body.joints[Joint.HEAD, 1] for body in bodies]
print(f"{len(bodies)} bodies, head between {min(head):.2f} and {max(head):.2f} m")
export(clip_of_bodies(bodies, [second - seconds[0] for second in seconds], "tracked"), "track_people.bvh")

shown = bodies[::29]
times = [round(29 * number / 30, 1) for number in range(len(shown))]
write_project_sheet("track_people.png", Project(), times, "A tracked performer", bodies=shown)
