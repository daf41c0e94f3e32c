"""A video file, frame by frame."""

from __future__ import annotations

import os
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Video", "check_video_path"]

QUALITY = 18
"""Of x264: lower is better, 18 can't be told from the original."""

COLOURS = "colormatrix=bt709:colorprim=bt709:transfer=bt709"
"""What players take a video of this size to be in, said outright."""


def check_video_path(path: Path) -> None:
    """Raise ValueError if no video can be written to ``path``."""
    if path.suffix.lower() != ".mp4":
        raise ValueError(f"a video is an MP4: {str(path)!r} should end in .mp4")
    if not path.parent.is_dir():
        raise ValueError(f"the video {str(path)!r} cannot be written: its folder does not exist")


class Video:
    """An MP4 (H.264, yuv420p, which browsers play) that grows; for a ``with`` statement.

    It is written under a temporary name beside the wanted one and renamed at the end, so that no
    half video is left.
    """

    def __init__(self, path: Path, size: tuple[int, int], frame_rate: int) -> None:
        """Start a video.

        Args:
            path: where to; it ends in ``.mp4``.
            size: width and height in pixels, both even.
            frame_rate: pictures a second.

        Raises:
            ValueError: a path that can't be written, or an odd size.
        """
        check_video_path(path)
        if size[0] % 2 or size[1] % 2:
            raise ValueError(f"a video's width and height must be even, not {size}")
        self._path, self._size, self._frame_rate = path, size, frame_rate
        self._part = path.with_name(f".{path.name}.{os.getpid()}.part")
        self._count = 0

    def __enter__(self) -> Video:
        import av  # 50 ms that only a video pays

        self._file = av.open(str(self._part), "w", format="mp4", options={"movflags": "faststart"})
        options = {"crf": str(QUALITY), "preset": "veryfast", "x264-params": COLOURS}
        self._stream: Any = self._file.add_stream("libx264", self._frame_rate, options=options)
        self._stream.width, self._stream.height = self._size
        self._stream.pix_fmt = "yuv420p"
        return self

    def add(self, picture: NDArray[np.uint8], frames: int = 1) -> None:
        """Show a picture, ``(h, w, 3)``, for so many frames."""
        import av

        shown = av.VideoFrame.from_ndarray(picture, format="rgb24")
        shown = shown.reformat(format="yuv420p", dst_colorspace="itu709")
        for _ in range(frames):
            shown.pts, shown.time_base = self._count, Fraction(1, self._frame_rate)
            self._count += 1
            self._file.mux(self._stream.encode(shown))

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        try:
            if kind is None:
                self._file.mux(self._stream.encode())
            self._file.close()
            if kind is None:
                self._part.replace(self._path)
        finally:
            self._part.unlink(missing_ok=True)
