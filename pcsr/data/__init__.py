"""TSR-PD: objects with a dense truth, a sparse cloud and touches (TAPSR, Sec. 4.1), built from any shapes."""
