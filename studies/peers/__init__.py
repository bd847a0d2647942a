"""Packages of others that run in an interpreter of their own, and how they are talked to.

`openscvx_process` starts the interpreter and exchanges lines with it; `openscvx_serving` is what answers them
there, and needs nothing of these packages. The studies that ask OpenSCvx bring the programmes.
"""
