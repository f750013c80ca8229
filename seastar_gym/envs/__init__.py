"""The Gymnasium environments: one robot (`SeastarSwimEnv`) and a native batch (`SeastarSwimVectorEnv`)."""
