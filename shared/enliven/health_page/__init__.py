"""The health page: a web page for technicians with the state of edges, programs and the computer, plus
metrics and alerts."""
