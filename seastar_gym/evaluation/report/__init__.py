"""The page that compares agents: tables, charts and a playback of every swim."""
