"""Runs one job of a batch: retargets a motion to a character, and records the result under a content hash.

A job's digest is the SHA-256 of both files, the mapping, the options and the version of enliven. A record
``.records/DIGEST.json`` in the folder of the results contains the hash of the result. A second run skips a
job if its record exists and its result has this hash. A result and its record are written completely or not
at all. So a worker may crash at any time, and two workers may run the same job.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import time
from dataclasses import asdict
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path

import msgspec

from enliven.errors import EnlivenError, InputError, ResourceError
from enliven.exporters import find_sheet_function
from enliven.files import DECODE_ERRORS, INVALID_NAME_REASON, file_fault, read_file, write_file
from enliven.formats.gltf.read import read_gltf
from enliven.formats.rig.rig import Rig
from enliven.oneshot.retargeting import RetargetedFile, RetargetOptions, retarget_file
from enliven.settings import load_settings

RECORDS = ".records"
"""Name of the folder of records within the folder of a character's results."""
_MAX_RECORD_BYTES = 1 << 20
"""Maximum size in bytes of a record that is read."""
_CACHED_DIGESTS = 100_000
"""Maximum number of file hashes in the cache. Its keys are path, size and modification time."""
_CACHED_MODELS = 1
"""Number of models that a worker keeps in memory. Jobs are sorted by character, so one is enough."""

_FileStamps = tuple[tuple[str, int, int], ...]
"""Path, size in bytes and modification time in nanoseconds of a file and of the files that it refers to."""


class BatchJob(msgspec.Struct, frozen=True):
    """A pair of a motion and a character.

    Attributes:
        motion, character, output: paths of the files.
        options: the values of :class:`RetargetOptions`.
        digest: hash of all inputs of the result.
        sheet: True to draw a contact sheet, ``MOTION.png`` in the folder of the result.
    """

    motion: str
    character: str
    output: str
    options: dict[str, str | float | bool | None]
    digest: str
    sheet: bool = False

    @property
    def name(self) -> str:
        """Name of the pair for messages."""
        return f"{Path(self.motion).stem} on {Path(self.character).stem}"

    @property
    def sheet_path(self) -> Path:
        """Path of the contact sheet."""
        return Path(self.output).with_suffix(".png")

    @property
    def record_path(self) -> Path:
        """Path of the record."""
        output = Path(self.output)
        return output.parent / RECORDS / f"{self.digest[:32]}.json"

    def with_absolute_paths(self) -> BatchJob:
        """Returns the job with absolute paths, because workers may have another current folder."""
        options = dict(self.options)
        if options["mapping"]:
            options["mapping"] = os.path.abspath(str(options["mapping"]))
        motion, character, output = map(os.path.abspath, (self.motion, self.character, self.output))
        return msgspec.structs.replace(
            self, motion=motion, character=character, output=output, options=options
        )


class JobResult(msgspec.Struct, frozen=True):
    """The result of a job.

    Attributes:
        job: the job.
        output_digest: SHA-256 of the written file. Empty if the job failed.
        problem: one sentence about the reason why the job failed, and the remedy. Empty if it succeeded.
        faults: visible faults of the motion, one sentence each.
        notes: unusual content of the files, one sentence each.
        measures: measures of the motion by name: ``seconds``, ``bytes``, ``pose_deg`` (median error of the
            worst limb), ``stretch`` (99th percentile), ``slide_cm_s``, ``floor`` (distance in heights),
            ``inside`` (fraction of the surface).
        took_s: processing time in seconds.
        is_new: False if an earlier run wrote it.
    """

    job: BatchJob
    output_digest: str = ""
    problem: str = ""
    faults: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    measures: dict[str, float] = {}
    took_s: float = 0.0
    is_new: bool = True


def create_job(
    motion: Path, character: Path, output: Path, options: RetargetOptions, sheet: bool = False
) -> BatchJob:
    """Returns the job of a pair, with its digest."""
    values = asdict(options)
    mapping = Path(options.mapping) if options.mapping else None
    content = {
        "version": version("enliven"),
        "motion": _hash_with_references(motion),
        "character": _hash_with_references(character),
        "mapping": _hash_with_references(mapping) if mapping else "",
        "options": {key: value for key, value in values.items() if key != "mapping"},
        "format": output.suffix,
        "names": [motion.stem, character.stem],
    }
    digest = hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
    return BatchJob(str(motion), str(character), str(output), values, digest, sheet)


def create_results_folder(path: Path) -> None:
    """Creates a folder of results, with the folders above it, if it does not exist.

    Raises:
        InputError: if the name of the folder is invalid.
        ResourceError: if it cannot be created.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except ValueError:
        raise InputError(INVALID_NAME_REASON, where=str(path), remedy="Choose another name.") from None
    except (FileExistsError, NotADirectoryError):
        raise ResourceError(
            "the results folder cannot be created, because this path or a folder above it is a file",
            where=str(path),
            remedy="Move the file, or choose another folder for the results.",
        ) from None
    except OSError as error:
        raise file_fault(error, path, "written") from None


def is_result(path: Path) -> bool:
    """Returns True if a file is in a folder of results, next to their records."""
    return (path.parent / RECORDS).is_dir()


def find_finished_result(job: BatchJob) -> JobResult | None:
    """Returns the result of an earlier run, or None if it is missing or its file has changed since."""
    try:
        data = read_file(job.record_path, _MAX_RECORD_BYTES)
        result = msgspec.json.decode(data, type=JobResult)
        lacks_sheet = job.sheet and not job.sheet_path.is_file()
        if lacks_sheet or result.output_digest != _hash_file(Path(job.output)):
            return None
    except (InputError, OSError, *DECODE_ERRORS):
        return None
    return msgspec.structs.replace(result, job=job, is_new=False)


def run_job(job: BatchJob) -> JobResult:
    """Runs one job and records it. A job that failed for a known reason has a result without a record.

    Raises:
        OSError: if the process runs out of a resource, such as open files. Then the job may be repeated.
    """
    started_at = time.monotonic()
    output = Path(job.output)
    try:
        create_results_folder(job.record_path.parent)
        options, character = _collect_options(job), Path(job.character)
        rig = _read_model(character, options.height)
        retargeted_file = retarget_file(Path(job.motion), character, output, options, rig)
        if job.sheet:
            find_sheet_function("motion")(job.sheet_path, retargeted_file.retargeted, job.name)
        result = JobResult(
            job,
            _hash_file(output),
            faults=tuple(retargeted_file.faults),
            notes=retargeted_file.notes,
            measures=_collect_measures(retargeted_file, output),
            took_s=time.monotonic() - started_at,
        )
        write_file(job.record_path, msgspec.json.encode(result))
    except EnlivenError as error:
        with contextlib.suppress(OSError):
            # Remove the folders only if they are empty.
            job.record_path.parent.rmdir()
            output.parent.rmdir()
        return JobResult(job, problem=str(error), took_s=time.monotonic() - started_at)
    return result


def _collect_options(job: BatchJob) -> RetargetOptions:
    """Returns the options of a job, which were passed to this process as plain values."""
    options = {name: value for name, value in job.options.items() if value is not None}
    return load_settings(RetargetOptions, options, where=job.name)


def _collect_measures(written: RetargetedFile, output: Path) -> dict[str, float]:
    """Returns the measures of a result, for the report."""
    measures = {"seconds": written.retargeted.duration, "bytes": float(output.stat().st_size)}
    quality = written.quality
    if quality is None:
        return measures
    limbs = [limb.median for limb in quality.limbs]
    optional = {"pose_deg": max(limbs) if limbs else None, "slide_cm_s": quality.slide}
    optional["floor"] = None if quality.sunk is None else max(quality.sunk, quality.afloat or 0.0)
    measures |= {"stretch": quality.stretch, "inside": quality.through}
    return measures | {name: value for name, value in optional.items() if value is not None}


def _read_model(path: Path, height: float | None) -> Rig:
    """Returns the model in a file. Uses a cache for an unchanged file."""
    try:
        stamps = _stamp_with_references(path)
    except OSError:
        return read_gltf(path, height=height)  # Raises an error with the reason.
    return _read_cached_model(stamps, height)


@lru_cache(maxsize=_CACHED_MODELS)
def _read_cached_model(stamps: _FileStamps, height: float | None) -> Rig:
    return read_gltf(Path(stamps[0][0]), height=height)


def _hash_with_references(path: Path) -> str:
    """Returns the hash of a file and of the files that a .gltf refers to. Uses a cache for unchanged
    files.
    """
    return _compute_cached_file_hash(_stamp_with_references(path))


def _stamp_with_references(path: Path) -> _FileStamps:
    """Returns path, size and modification time of a file and of the files that a .gltf refers to."""
    parts = [path]
    if path.suffix.lower() == ".gltf":
        parts += sorted(file for file in path.parent.rglob("*") if file.is_file() and file != path)
    return tuple((str(part), os.stat(part).st_size, os.stat(part).st_mtime_ns) for part in parts)


@lru_cache(maxsize=_CACHED_DIGESTS)
def _compute_cached_file_hash(stamps: _FileStamps) -> str:
    hashes = [_hash_file(Path(name)) for name, _, _ in stamps]
    return hashes[0] if len(hashes) == 1 else hashlib.sha256("".join(hashes).encode()).hexdigest()


def _hash_file(path: Path) -> str:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
