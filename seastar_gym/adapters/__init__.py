"""The native batch in the forms of other libraries, each imported by those who use it."""
