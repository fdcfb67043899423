"""Sessions: lists of an artist's actions, which drive the studio's own tools.

    session = [Key("m"), Click(Widget("takes")), Click(JointPlace("tentacle", 0)), Drag(...), Wait(1.0)]
    play(session, HeadlessStage(workspace))   # without a window, for tests
    film(session, workspace, path)            # in the real window, into a film: enliven_viewer.studio.filming

Places are looked up when they are needed: a joint is clicked where it then is on the screen.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
