"""The method Walking Depth Plane: Mueller, Grottel and Ertl 2007, section 3.2.

A plane of distances, one for each pixel, walks into the view until it lies on the surface. In each pass the balls' densities
are summed by additive blending at four places ahead of the plane (3.2.2); then the plane goes on, by the authors' oracle: the
nearer the density comes to the threshold, the shorter the step (3.2.3). The loop ends when all rays have arrived, when a share
of them has, after a number of passes, or with a budget of time (3.2.4). Gradient and attributes are summed in the end (3.2.5).

What differs from the paper, and why:

- A step is by the smallest ball about the place, not by the smallest of all: the pass also finds, by blending with MIN, how
  small the balls are that reach the samples, and where one begins that is too small for the step. So radii may differ by
  orders of magnitude.
- Where no ball reaches the plane it leaps to where the next one begins, which the authors wished for.
- The four places ahead are as far apart as one step of the oracle. The first that lies in the fluid ends the walk; else the
  plane goes on to the last that is not more than twice as far as the oracle would have gone from the one before.
- Steps do not shorten without end: to rise above the threshold and fall again within the shortest, the density would have to
  change by less than the tolerance. Otherwise the plane would hardly come past a place where it all but touches.
- What is found is a bracket. The oracle's steps from both ends, forward and back, its secant and its middle narrow it at once,
  so that the walk back cannot swing.
- A ray that starts in the fluid walks by the mirrored density, to the surface that it sees from within.

As with any sampling, what is thinner than a step and far from the threshold on both sides may be missed.
"""
