"""Evaluation: one swim or many side by side, nominal or disturbed, and what can be measured on them."""
