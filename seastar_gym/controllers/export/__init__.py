"""Learned policies without Python: one file of C, or of ONNX.

tables.py   what both have of symmetry, as tables that follow from `seastar_gym.envs.symmetry`
c_code.py   constants and tables in C, above the code of policy.c
onnx_graph.py   a graph from observations to actions

    seastar export learned --to c --out policy.c
"""
