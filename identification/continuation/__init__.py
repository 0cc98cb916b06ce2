"""Arc-length continuation: follow a curve of solutions of ``F(z, p) = 0`` through its turning points.

F returns as many values as there are unknowns z; p is one additional parameter. Each step predicts along the tangent and
corrects by Newton's method in the plane normal to it (pseudo-arclength: Keller, in Applications of Bifurcation Theory, 1977;
Allgower and Georg, Introduction to Numerical Continuation Methods, 2003, chapters 2 and 6). The equations of the correction
stay regular at a turning point. Length is measured in units that grow with the unknowns,

    ds^2 = |dz / scale|^2 / max(1, |z / scale|)^2 + (dp / parameter_scale)^2,

so that one step control serves unknowns of every size: where the unknowns exceed ``scale``, a step is relative to their
present size.
"""
