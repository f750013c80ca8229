"""The chapter's figures, drawn anew."""
