"""The control law as mathematics: target impedances, sliding surfaces, reaching laws, limits, certificates.

May use: `_common`, NumPy and SciPy; it knows no robot.
"""
