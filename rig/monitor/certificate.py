"""TLS for pages that are watched from another machine: a certificate's files, or one made for this server alone."""

import hashlib
import ipaddress
import os
import secrets
import ssl
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path

from rig.errors import ConfigurationError
from rig.live.place import base_folder
from vibrolock.printable import error_text

VALID_D = 30  # days; chosen: longer than any test
EARLIER_D = 1  # the phone's clock may be behind


def from_files(certificate: Path, key: Path | None) -> tuple[ssl.SSLContext, str]:
    """Return TLS with a certificate's file (PEM) and that of its key, which may be the same; and the fingerprint.

    Raises:
        ConfigurationError: they cannot be read, do not belong together, or the key asks for a password.
    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    try:
        context.load_cert_chain(certificate, key, password=_no_password)
        return context, fingerprint(certificate.read_text(encoding="ascii"))
    except (OSError, ValueError) as error:  # SSLError is an OSError
        named = f"`certificate` = {certificate}" + (f", `key` = {key}" if key is not None else "")
        raise ConfigurationError(error_text(error), where=named, allowed="a certificate and its key as PEM") from error


def _no_password() -> bytes:
    raise ValueError("the key asks for a password")


def self_signed(address: str) -> tuple[ssl.SSLContext, str]:
    """Return TLS with a certificate made now for an address, and its fingerprint. The key is nowhere but in memory.

    Raises:
        OSError: there is no room for the file through which the key must go.
    """
    pem, key = _made(address)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    path = base_folder() / f"tls-{secrets.token_hex(8)}.pem"  # in memory where the system has such files
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    try:
        with os.fdopen(descriptor, "wb") as stream:
            stream.write(key + pem)
        context.load_cert_chain(path)  # the library reads keys from files alone
    finally:
        with suppress(OSError):
            path.unlink()
    return context, fingerprint(pem.decode("ascii"))


def fingerprint(pem: str) -> str:
    """Return the SHA-256 fingerprint of a certificate as browsers show it."""
    end = pem.index("-----END CERTIFICATE-----") + len("-----END CERTIFICATE-----")
    digest = hashlib.sha256(ssl.PEM_cert_to_DER_cert(pem[pem.index("-----BEGIN CERTIFICATE-----") : end]))
    return digest.digest().hex(":").upper()


def _made(address: str) -> tuple[bytes, bytes]:
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "vibrolock monitor")])
    try:
        named: x509.GeneralName = x509.IPAddress(ipaddress.ip_address(address))
    except ValueError:
        named = x509.DNSName(address)
    now = datetime.now(UTC)
    built = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - timedelta(days=EARLIER_D))
        .not_valid_after(now + timedelta(days=VALID_D))
        .add_extension(x509.SubjectAlternativeName([named]), critical=False)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH]), critical=False)
        .sign(key, hashes.SHA256())
    )
    return built.public_bytes(serialization.Encoding.PEM), key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
