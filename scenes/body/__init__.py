"""`taichi-cloth body`: a body in parts and primitives, drawn and measured."""
