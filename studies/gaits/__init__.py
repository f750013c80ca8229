"""Periodic gaits in time: every gait from rest, gaits that evolve, and what speed costs in heat."""
