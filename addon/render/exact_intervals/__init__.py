"""The method Exact Intervals: every crossing, every interval's polynomial, in double precision on the CPU.

Nishita and Nakamae 1994, as Kanamori et al. 2008 describe it in section 3.1, for all rays of a band at once. The oracle
runs the same code on arbitrary rays.
"""
