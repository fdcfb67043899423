"""The health page: state of edges, programs and machine, with metrics, alerts and a page for technicians."""
