"""The atlas of stability: eight quantities against time steps from 10 µs to 1 s."""
