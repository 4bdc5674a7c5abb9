"""The optimisations of Depth Peeling, each of which can be switched off to see its worth. The image stays the same."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Options:
    """Numbers of sections refer to Kanamori et al. 2008.

    Attributes
    ----------
    tight_rectangles
        A ball is drawn as the rectangle between the tangents from the eye (5.1), else as that of the cube around it.
    kernel_spheres
        A ray ends at the nearest kernel sphere (5.2), else only where it meets no ball any more. Without it nothing can be
        culled.
    group_queries
        Groups of neighbouring balls are left out when an occlusion query says that kernel spheres hide them (5.2).
    ball_culling
        A ball is left out where the farthest kernel sphere of its cells is nearer (5.2).
    tiling
        Balls are drawn by cells of the image, and cells that are done are left out (5.3); else the image is one cell.
    short_stack
        Bezier clipping keeps three segments on a stack (5.4), else it cuts them anew.
    diagnostics
        Count what would cost time to count: balls that remain after culling, and the steps of Bezier clipping.
    """

    tight_rectangles: bool = True
    kernel_spheres: bool = True
    group_queries: bool = True
    ball_culling: bool = True
    tiling: bool = True
    short_stack: bool = True
    diagnostics: bool = False
