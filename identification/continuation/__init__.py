"""Arc-length continuation: a curve of solutions of ``F(z, p) = 0``, followed through its turning points.

F gives as many values as there are unknowns z, and p is one parameter more. A step goes along the tangent and returns to
the curve by Newton's method in the plane across it (pseudo-arclength: Keller, in Applications of Bifurcation Theory, 1977;
Allgower and Georg, Introduction to Numerical Continuation Methods, 2003, chapters 2 and 6), where nothing becomes singular at
a turning point. Length is measured in units that go with the curve,

    ds^2 = |dz / scale|^2 / max(1, |z / scale|)^2 + (dp / parameter_scale)^2,

so that one step control serves unknowns of every size: from ``scale`` on a step is a share of what is there.
"""
