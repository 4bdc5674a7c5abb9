"""What methods share that find the surface by sampling: they ask for densities at up to four distances along each pixel's ray,
which are summed by additive blending of the balls' billboards (Mishima et al. 2008, section 4), and leave a bracket where the
density passes the threshold. From there on the rest is done: the bracket is narrowed, gradient and attributes are summed, and
the surface is written.

A method brings programs of its own that decide which distances to ask for next; see :mod:`passes`.
"""
