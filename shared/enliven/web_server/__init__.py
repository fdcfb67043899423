"""The common parts of the web servers: access control, the TLS certificate, and the address to listen on."""
