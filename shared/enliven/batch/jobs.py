"""One pair of a batch: retargets a motion onto a character, and records the result under a content hash.

A job's digest is the SHA-256 of both files, the mapping, the options and the version of enliven. A record
``.records/DIGEST.json`` in the folder of the results states the hash of the result. A second run skips a job
if its record exists and its result has that hash. A result and its record are each written completely or not
at all. So a worker may crash at any time, and two workers may do the same job.
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

from enliven.errors import EnlivenError, InputError
from enliven.exporters import find_sheet_function
from enliven.files import read_file, write_file
from enliven.oneshot.retargeting import RetargetedFile, RetargetOptions, retarget_file
from enliven.settings import load_settings

RECORDS = ".records"
"""Folder of the records, in the folder of a character's results."""
_MAX_RECORD_BYTES = 1 << 20
"""Maximum bytes of a record that is read."""
_CACHED_DIGESTS = 100_000
"""Maximum number of file hashes in the cache. Its keys are path, size and modification time."""


class BatchJob(msgspec.Struct, frozen=True):
    """One pair of a motion and a character.

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
    def record(self) -> Path:
        """Path of the record."""
        output = Path(self.output)
        return output.parent / RECORDS / f"{self.digest[:32]}.json"


class JobResult(msgspec.Struct, frozen=True):
    """The result of a job.

    Attributes:
        job: the job.
        output_digest: SHA-256 of the written file. Empty if the job failed.
        problem: why the job failed, one sentence with a remedy. Empty if it succeeded.
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


def find_finished_result(job: BatchJob) -> JobResult | None:
    """Returns the result of an earlier run, or None if it is missing or its file has changed since."""
    try:
        data = read_file(job.record, _MAX_RECORD_BYTES)
        result = msgspec.json.decode(data, type=JobResult)
        lacks_sheet = job.sheet and not job.sheet_path.is_file()
        if lacks_sheet or result.output_digest != _hash_file(Path(job.output)):
            return None
    except (InputError, OSError, msgspec.DecodeError, UnicodeDecodeError):
        return None
    return msgspec.structs.replace(result, job=job, is_new=False)


def run_job(job: BatchJob) -> JobResult:
    """Does one job and records it. A job that failed for a known reason has a result, too, but no record.

    Raises:
        OSError: if the process runs out of a resource, such as open files. Then the job may be repeated.
    """
    started_at = time.monotonic()
    output = Path(job.output)
    try:
        output.parent.mkdir(parents=True, exist_ok=True)
        retargeted_file = retarget_file(
            Path(job.motion),
            Path(job.character),
            output,
            _collect_options(job),
        )
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
        job.record.parent.mkdir(exist_ok=True)
        write_file(job.record, msgspec.json.encode(result))
    except EnlivenError as error:
        with contextlib.suppress(OSError):
            output.parent.rmdir()  # Removes the folder only if it is empty.
        return JobResult(job, problem=str(error), took_s=time.monotonic() - started_at)
    return result


def _collect_options(job: BatchJob) -> RetargetOptions:
    """Returns the options of a job. They were passed to this process as plain values."""
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


def _hash_with_references(path: Path) -> str:
    """Returns the hash of a file and of the files that a .gltf refers to. Uses a cache for unchanged
    files.
    """
    parts = [path]
    if path.suffix.lower() == ".gltf":
        parts += sorted(file for file in path.parent.rglob("*") if file.is_file() and file != path)
    stamps = tuple((str(part), os.stat(part).st_size, os.stat(part).st_mtime_ns) for part in parts)
    return _cached_file_hash(stamps)


@lru_cache(maxsize=_CACHED_DIGESTS)
def _cached_file_hash(stamps: tuple[tuple[str, int, int], ...]) -> str:
    hashes = [_hash_file(Path(name)) for name, _, _ in stamps]
    return hashes[0] if len(hashes) == 1 else hashlib.sha256("".join(hashes).encode()).hexdigest()


def _hash_file(path: Path) -> str:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
