"""Agents for SeastarSwim-v0: scripted gaits, PPO, and their evaluation."""
