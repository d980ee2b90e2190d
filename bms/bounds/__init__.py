"""Bounds on the error of the estimate, each with what it rests on.

theorem: how fast splines approach the best static map as their grid gets finer (the paper's
M G^-(k+1)). worst_case: the largest error that a search over charging profiles finds. conformal:
what held-out profiles say, at a stated confidence.
"""
