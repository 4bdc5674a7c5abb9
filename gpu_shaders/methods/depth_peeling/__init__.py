"""The method Depth Peeling: Kanamori, Szego and Nishita 2008.

The influence spheres are drawn again and again; each time the next one that a pixel's ray enters is peeled off, the list of
the balls that the ray is in is brought up to date, and the way since the entry before is searched for the surface by Bezier
clipping (sections 3 and 4). Spheres are drawn as tight rectangles (5.1), those hidden by kernel spheres are left out (5.2), the
image is tiled (5.3), and Bezier clipping has a short stack (5.4).

What differs from the paper, and why:

- Entries are ordered by (distance, ball) instead of by distance alone, so none is lost where several coincide. Exits are not
  peeled: where a ray leaves a ball of its list is known.
- A ray whose list overflows is not given a wrong surface: it goes on by safe steps, on sums that have no limit.
- Tiles are a hierarchy of cells. Pairs of balls and cells are made, and thinned out, on the graphics processor.
- The gradient at the surface is summed by blending, from exactly the balls that reach there.
"""
