"""The method Equal Interval: Mishima, Tanaka and Sagawa 2008.

Each ray takes samples of the density at equal intervals, four at once, and leaps over places where no ball can let the
density rise (section 3). Densities are summed by additive blending of the balls' billboards (4.1, 4.2); balls that reach no
sample of the pixels around them are not drawn (4.3). Where a sample is above the threshold, secants narrow the way from the
one before (5).

What differs from the paper, and why:

- Distances are reduced by blending with MIN instead of by the depth test, because three are looked for at once: where the ray
  goes on, how long the interval is there, and how long after a leap. The shader writes no depth then, so rays that have
  stopped are dropped before it runs, by the depth that is there.
- A ball asks for samples from where the ray enters its sphere, not its cube, to its centre, where its density ceases to rise;
  and for one more: what rises above the threshold just before the centre and stays there is not missed. A ball of negative
  weight asks behind its centre, and so do all others for a ray that starts in the fluid and looks for its way out. So the half
  that is left out never has a crossing that is looked for.
- The interval is that of the smallest ball that asks, and a stretch of samples ends where a smaller one begins.
- Where no ball has a negative weight, balls that begin behind the nearest kernel sphere (Kanamori et al. 2008, section 5.2) are
  not asked where a ray may go on: it ends before.
- Where the limit leaves rays without an answer they are counted. With the adaptive interval, the authors' proposal for crowded
  places, no ray is left before it has taken GRACE times the limit.
"""
