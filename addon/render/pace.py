"""How large an image may be to come in time."""

from __future__ import annotations

SHARE = 0.5
"""Of the time from one image to the next that rendering may take; the rest is for Blender's own drawing and for reading."""

_DIVISORS = (1, 2, 3, 4, 6, 8)
_FIRST_PIXELS = 120_000
"""For the first image, when nothing is known."""


class Pace:
    """Learns from each image what a pixel takes, and what an image takes apart from its pixels."""

    def __init__(self) -> None:
        self._small: tuple[int, float] | None = None
        self._large: tuple[int, float] | None = None
        self._presenting = 0.0

    def note(self, pixels: int, seconds: float) -> None:
        """An image of so many pixels took so long."""
        if self._large is None or pixels >= self._large[0]:
            if self._large is not None and pixels > self._large[0]:
                self._small = self._large
            self._large = pixels, seconds
        else:
            self._small = pixels, seconds

    def note_presenting(self, pixels: int, seconds: float) -> None:
        """To bring an image of so many pixels to the screen took so long."""
        self._presenting = seconds / pixels

    def size(self, width: int, height: int, interval: float) -> tuple[int, int]:
        """Size of the image that can be had at one each `interval` seconds: the whole size or an integer part of it."""
        divisor = next((divisor for divisor in _DIVISORS if self._fits(width * height // divisor**2, interval)), _DIVISORS[-1])
        return -(-width // divisor), -(-height // divisor)

    def _fits(self, pixels: int, interval: float) -> bool:
        if self._large is None:
            return pixels <= _FIRST_PIXELS
        base, per_pixel = self._costs()
        # Where most of the time does not depend on the pixels, fewer of them would only look worse.
        return (per_pixel + self._presenting) * pixels <= max(SHARE * interval - base, base / 2)

    def _costs(self) -> tuple[float, float]:
        """Seconds that an image takes apart from its pixels, and seconds a pixel."""
        assert self._large is not None
        pixels, seconds = self._large
        if self._small is None:
            return 0.0, seconds / pixels
        per_pixel = max(seconds - self._small[1], 0.0) / (pixels - self._small[0])
        return max(seconds - per_pixel * pixels, 0.0), per_pixel
