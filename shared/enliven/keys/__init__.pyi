from .curve import (
    CurveChannel as CurveChannel,
    CurveError as CurveError,
    CurveServer as CurveServer,
)
from .client import (
    ClientKeys as ClientKeys,
    HandshakeProblem as HandshakeProblem,
    HandshakeWatch as HandshakeWatch,
    find_client_keys as find_client_keys,
    handshake_advice as handshake_advice,
)
from .key_files import (
    KeyPair as KeyPair,
    KeyStore as KeyStore,
    PairedEdge as PairedEdge,
    PairedViewer as PairedViewer,
    clean_name as clean_name,
    fingerprint as fingerprint,
    make_key_pair as make_key_pair,
)
from .pairing import (
    EdgeExchange as EdgeExchange,
    Introduction as Introduction,
    PairingDesk as PairingDesk,
    PairingError as PairingError,
    ViewerExchange as ViewerExchange,
    limit_role as limit_role,
)
from .roles import ROLES as ROLES, Role as Role, includes as includes
