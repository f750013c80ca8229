"""Controllers: scripted gaits, the greedy agent, the planner, and learned policies with their weights.

They need numpy and safetensors. What an agent of one's own must have is in `contract.py`; names are in `roster.py`.
"""
