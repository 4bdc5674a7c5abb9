"""The method Depth Peeling: Kanamori, Szego and Nishita 2008, sections 3 and 4.

The influence spheres are drawn again and again; each time the next crossing of every pixel's ray is peeled off, the list
of the balls that the ray is in is brought up to date, and the interval since the crossing before is searched for the
surface by Bezier clipping.

What differs from the paper, and why:

- Crossings are ordered by (distance, ball, entry before exit) instead of by distance alone, so none is lost where several
  coincide.
- A ray whose list overflows is not given a wrong surface: its peeling is done again with the balls of each interval summed
  by blending, which has no limit.
- The gradient at the surface is summed by blending as well, from exactly the balls that reach there.
"""
