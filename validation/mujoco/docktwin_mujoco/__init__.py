"""A second engine for docktwin's cross-check: MuJoCo integrates, and geometry and law are written
again here from the model files. Nothing is shared with the Rust side but those files.

SI units and radians throughout. `r_ab` takes components in B to components in A, `p_ab` is the
position of B's origin from A's, in A.
"""
