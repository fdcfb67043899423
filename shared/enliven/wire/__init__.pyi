from .characters import MAX_TEXTURE_BYTES as MAX_TEXTURE_BYTES, CharacterMessage as CharacterMessage
from .convert import (
    as_sent as as_sent,
    bodies_to_message as bodies_to_message,
    cues_to_message as cues_to_message,
    health_to_messages as health_to_messages,
    message_to_bodies as message_to_bodies,
    message_to_cues as message_to_cues,
    message_to_owners as message_to_owners,
    message_to_pose as message_to_pose,
    message_to_props as message_to_props,
    messages_to_health as messages_to_health,
    pose_to_message as pose_to_message,
    props_to_message as props_to_message,
)
from .convert_characters import (
    character_to_message as character_to_message,
    message_to_character as message_to_character,
)
from .envelope import (
    Malformed as Malformed,
    OtherVersion as OtherVersion,
    Rejects as Rejects,
    pack_control as pack_control,
    pack_stream as pack_stream,
    payload as payload,
    reply_head as reply_head,
    unpack_control as unpack_control,
    unpack_stream as unpack_stream,
)
from .fields import (
    MAX_GROWTH as MAX_GROWTH,
    MAX_PART_BYTES as MAX_PART_BYTES,
    MAX_SENT_BYTES as MAX_SENT_BYTES,
    MAX_SETTINGS as MAX_SETTINGS,
)
from .matches import board_to_message as board_to_message, message_to_board as message_to_board
from .ports import free_ports as free_ports
from .posecode import PoseCodec as PoseCodec, warm_up as warm_up
from .requests import (
    REQUESTS as REQUESTS,
    SUPERSEDED as SUPERSEDED,
    Answer as Answer,
    Ask as Ask,
    Awaited as Awaited,
    Browse as Browse,
    CharacterPart as CharacterPart,
    Done as Done,
    GetState as GetState,
    Hello as Hello,
    Lock as Lock,
    Look as Look,
    Mode as Mode,
    Order as Order,
    Ping as Ping,
    Pong as Pong,
    Possess as Possess,
    PutCharacter as PutCharacter,
    Refused as Refused,
    Release as Release,
    RemoveCharacter as RemoveCharacter,
    Resize as Resize,
    Reply as Reply,
    Request as Request,
    Scan as Scan,
    Smooth as Smooth,
    Welcome as Welcome,
)
from .scans import (
    MAX_PIECE_FACES as MAX_PIECE_FACES,
    MAX_PIECE_VERTICES as MAX_PIECE_VERTICES,
    ScanMessage as ScanMessage,
    ScanPieceMessage as ScanPieceMessage,
    ThingWord as ThingWord,
)
from .sockets import (
    CONTROL_PORT as CONTROL_PORT,
    POSE_PORT as POSE_PORT,
    Endpoint as Endpoint,
    make_socket as make_socket,
    parse_endpoint as parse_endpoint,
)
from .streams import (
    CallMessage as CallMessage,
    BodiesMessage as BodiesMessage,
    CuesMessage as CuesMessage,
    HoldMessage as HoldMessage,
    MatchesMessage as MatchesMessage,
    PoseMessage as PoseMessage,
    PropsMessage as PropsMessage,
    Revision as Revision,
    SizeMessage as SizeMessage,
    StageMessage as StageMessage,
    StatusMessage as StatusMessage,
)
from .topics import (
    CALLS as CALLS,
    BODIES as BODIES,
    BY_TYPE as BY_TYPE,
    CHARACTER as CHARACTER,
    CUES as CUES,
    HOLDS as HOLDS,
    MATCHES as MATCHES,
    MAX_STREAM_BYTES as MAX_STREAM_BYTES,
    POSE as POSE,
    PROPS as PROPS,
    REPLY as REPLY,
    REQUEST as REQUEST,
    SCAN as SCAN,
    SCAN_PIECE as SCAN_PIECE,
    SIZES as SIZES,
    STAGE as STAGE,
    STATUS as STATUS,
    STREAMS as STREAMS,
    TOPICS as TOPICS,
    Topic as Topic,
    register as register,
)
from .zmtp import ZmtpError as ZmtpError, ZmtpSession as ZmtpSession, framed as framed, head as head
