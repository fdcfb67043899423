from .frame_to_model_tracking import Alignment as Alignment, CameraTracker as CameraTracker
from .cutting import (
    CutBox as CutBox,
    CutOut as CutOut,
    KnownImage as KnownImage,
    cut_by_box as cut_by_box,
    cut_what_is_new as cut_what_is_new,
    upright_frame as upright_frame,
)
from .ground_plane import (
    GroundPlane as GroundPlane,
    cut_out as cut_out,
    find_ground as find_ground,
    focus_of as focus_of,
    largest_part as largest_part,
    levelled as levelled,
    parts_about as parts_about,
)
from .decimation import DecimatedMesh as DecimatedMesh, decimated as decimated
from .depth_view import DepthPreparation as DepthPreparation, DepthView as DepthView
from .keyframes import Keyframes as Keyframes
from .loop_closure import LoopClosure as LoopClosure
from .marching_cubes import surface_of as surface_of
from .preview import (
    PIECE_STEPS as PIECE_STEPS,
    PieceSums as PieceSums,
    ScanPiece as ScanPiece,
    piece_of as piece_of,
    piece_sums as piece_sums,
)
from .rasterizer import Drawing as Drawing, draw_mesh as draw_mesh
from .scanner import (
    ExcludedPixels as ExcludedPixels,
    Scanner as Scanner,
    ScanState as ScanState,
    ScanStep as ScanStep,
)
from .settings import (
    CutOutSettings as CutOutSettings,
    LoopSettings as LoopSettings,
    DepthNoiseModel as DepthNoiseModel,
    ScanSettings as ScanSettings,
    VolumeSettings as VolumeSettings,
    ObjectSettings as ObjectSettings,
    RegistrationSettings as RegistrationSettings,
    TrackingSettings as TrackingSettings,
    alone_within as alone_within,
)
from .tsdf_volume import FusionResult as FusionResult, TsdfVolume as TsdfVolume
