from .frame_to_model_tracking import Alignment as Alignment, CameraTracker as CameraTracker
from .cutting.box import CutBox as CutBox, cut_by_box as cut_by_box, upright_frame as upright_frame
from .cutting.parts import CutOut as CutOut
from .cutting.moved import KnownImage as KnownImage, cut_new_object as cut_new_object
from .ground_plane import (
    GroundPlane as GroundPlane,
    cut_out as cut_out,
    find_ground as find_ground,
    find_focus as find_focus,
    find_largest_part as find_largest_part,
    level_mesh as level_mesh,
    find_parts as find_parts,
)
from .decimation import DecimatedMesh as DecimatedMesh, decimate as decimate
from .depth_view import DepthPreparation as DepthPreparation, DepthView as DepthView
from .keyframes import Keyframes as Keyframes
from .loop_closure.loop_detection import LoopClosure as LoopClosure
from .marching_cubes import extract_surface as extract_surface
from .preview import (
    PIECE_STEPS as PIECE_STEPS,
    PieceSums as PieceSums,
    ScanPiece as ScanPiece,
    extract_piece as extract_piece,
    sum_pieces as sum_pieces,
)
from .rasterizer import RenderedMesh as RenderedMesh, draw_mesh as draw_mesh
from .scanner import (
    ExcludedPixels as ExcludedPixels,
    Scanner as Scanner,
    ScanState as ScanState,
    ScanStep as ScanStep,
)
from .settings import (
    CutOutSettings as CutOutSettings,
    DepthNoiseModel as DepthNoiseModel,
    ScanSettings as ScanSettings,
    VolumeSettings as VolumeSettings,
    ObjectSettings as ObjectSettings,
    TrackingSettings as TrackingSettings,
    settings_within as settings_within,
)
from .tsdf_volume import FusionResult as FusionResult, TsdfVolume as TsdfVolume
