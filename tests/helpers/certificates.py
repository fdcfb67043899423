"""Self-signed certificates of localhost, for the tests of web servers."""

from __future__ import annotations

import datetime
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID


class CertificateFolder:
    """Makes self-signed certificates of localhost."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def make(
        self, name: str, begin: datetime.datetime | None = None, days: float = 30.0, passphrase: bytes = b""
    ) -> tuple[Path, Path]:
        """Returns the files of a certificate and its key.

        Args:
            begin: start of its validity. None: one day ago.
            days: duration of its validity.
            passphrase: encrypts the key, unless it is empty.
        """
        begin = begin or datetime.datetime.now(datetime.UTC) - datetime.timedelta(days=1.0)
        key = ec.generate_private_key(ec.SECP256R1())
        subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "localhost")])
        certificate = (
            x509.CertificateBuilder()
            .subject_name(subject)
            .issuer_name(subject)
            .public_key(key.public_key())
            .serial_number(x509.random_serial_number())
            .not_valid_before(begin)
            .not_valid_after(begin + datetime.timedelta(days=days))
            .add_extension(x509.SubjectAlternativeName([x509.DNSName("localhost")]), critical=False)
            .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
            .sign(key, hashes.SHA256())
        )
        encryption = (
            serialization.BestAvailableEncryption(passphrase) if passphrase else serialization.NoEncryption()
        )
        path, key_path = self._folder / f"{name}.pem", self._folder / f"{name}.key"
        path.write_bytes(certificate.public_bytes(serialization.Encoding.PEM))
        key_path.write_bytes(
            key.private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, encryption)
        )
        key_path.chmod(0o600)
        return path, key_path
