"""Follow a running edge (`enliven edge --sensor synthetic`): listen_to_edge.py [HOST:PORT [SECONDS]]"""

import sys
import time

from enliven_viewer.link.edge_client import EdgeClient

edge = EdgeClient(sys.argv[1:2] or ["127.0.0.1:5580"], name="listener")
end = time.monotonic() + float((sys.argv[2:3] or ["10"])[0])
while time.monotonic() < end:
    edge.poll()
    for endpoint, health in edge.health.items():
        print(f"{endpoint}: {health.text}, {health.pose_hz:.0f} poses a second")
    print("characters:", [*edge.characters])
    time.sleep(1.0)
edge.close()
