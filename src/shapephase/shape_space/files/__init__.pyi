from .read import RecordedMotion, read_recorded_motion, read_shape_path, write_shape_path
from .recording import (
    Recording,
    check_size,
    check_text,
    digest,
    file_bytes,
    number,
    plain_numbers,
    times_from_zero,
    warn,
)
from .smoothing import smoothed_path

__all__ = [
    "RecordedMotion",
    "Recording",
    "check_size",
    "check_text",
    "digest",
    "file_bytes",
    "number",
    "plain_numbers",
    "read_recorded_motion",
    "read_shape_path",
    "smoothed_path",
    "times_from_zero",
    "warn",
    "write_shape_path",
]
