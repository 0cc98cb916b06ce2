"""TLS for other machines: a certificate's files or one made for the occasion; its fingerprint; no key left behind."""

import hashlib
import ssl

import pytest

from rig.errors import ConfigurationError
from rig.live.place import base_folder
from rig.monitor.certificate import _made
from rig.monitor.process import Address
from tests.refused import refused
from tests.rig.monitor.scripted import Scripted
from tests.rig.monitor.visitor import Visitor, heard, served


@pytest.fixture
def files(tmp_path):
    """Certificate and key of somebody's own."""
    certificate, key = _made("127.0.0.1")
    (tmp_path / "cert.pem").write_bytes(certificate)
    (tmp_path / "key.pem").write_bytes(key)
    return tmp_path / "cert.pem", tmp_path / "key.pem"


def trusting(server) -> ssl.SSLContext:
    """What a person does who has compared the fingerprints: trust this certificate, and check the name in it."""
    pem = ssl.get_server_certificate(("127.0.0.1", server.port))
    digest = hashlib.sha256(ssl.PEM_cert_to_DER_cert(pem)).hexdigest().upper()
    assert server.fingerprint.replace(":", "") == digest
    return ssl.create_default_context(cadata=pem)


def test_an_address_for_others_gets_a_certificate_made_for_it(monkeypatch):
    monkeypatch.setattr(Address, "loopback", False)  # as if it were another
    run = Scripted()
    with served(run) as server:
        assert server.url.startswith("https://127.0.0.1:")
        assert not list(base_folder().glob("tls-*"))
        visitor = Visitor(server.url, trusting(server))
        assert "; Secure" in visitor.get(visitor.door).headers["set-cookie"]
        inside = Visitor(server.url, trusting(server)).enter()
        with inside.feed() as socket:
            assert heard(socket)["is"] == "whole"
        assert inside.get("/", Host=f"localhost:{server.port}").status == 421  # only at the address that was given
        assert inside.stop(Origin=f"http://127.0.0.1:{server.port}").status == 403
        assert inside.stop().status == 200
        assert run.stops == ["stopped on the page"]


def test_every_server_makes_its_own():
    assert _made("10.0.0.1")[1] != _made("10.0.0.1")[1]


@pytest.mark.parametrize("address", ["10.1.2.3", "fd00::2", "bench.lab.example"])
def test_the_certificate_is_for_the_address(address, tmp_path):
    (tmp_path / "cert.pem").write_bytes(_made(address)[0])
    told = dict(ssl._ssl._test_decode_cert(str(tmp_path / "cert.pem")))
    kind = "DNS" if address.endswith("example") else "IP Address"
    expected = "FD00:0:0:0:0:0:0:2" if ":" in address else address
    assert told["subjectAltName"] == ((kind, expected),)


def test_files_of_ones_own_are_used(files):
    certificate, key = files
    with served(Scripted(), address=Address(certificate=certificate, key=key)) as server:
        assert ssl.get_server_certificate(("127.0.0.1", server.port)) == certificate.read_text()
        Visitor(server.url, trusting(server)).enter()


def test_certificate_and_key_may_be_one_file(files, tmp_path):
    certificate, key = files
    (tmp_path / "both.pem").write_bytes(key.read_bytes() + certificate.read_bytes())
    with served(Scripted(), address=Address(certificate=tmp_path / "both.pem")) as server:
        Visitor(server.url, trusting(server)).enter()


def test_the_plain_page_is_not_served_beside_tls(files):
    with served(Scripted(), address=Address(certificate=files[0], key=files[1])) as server:
        visitor = Visitor(server.url.replace("https", "http"))
        with pytest.raises(OSError):  # noqa: PT011 (whatever the system says)
            visitor.get("/page/plain.css")


@pytest.mark.parametrize("wrong", ["missing", "text", "other key", "password", "folder"])
def test_files_that_are_of_no_use_are_named_in_one_line(files, tmp_path, wrong):
    certificate, key = files
    if wrong == "missing":
        certificate.unlink()
    elif wrong == "text":
        certificate.write_text("hello")
    elif wrong == "other key":
        key.write_bytes(_made("127.0.0.1")[1])
    elif wrong == "password":
        key.write_bytes(_locked(key.read_bytes()))
    else:
        certificate = tmp_path
    with refused(ConfigurationError, "certificate-key-allowed", allowed="a certificate and its key as PEM") as error:
        Address(certificate=certificate, key=key).secured()
    assert "\n" not in str(error.value)


def _locked(key: bytes) -> bytes:
    from cryptography.hazmat.primitives import serialization

    loaded = serialization.load_pem_private_key(key, None)
    return loaded.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.BestAvailableEncryption(b"secret")
    )
