# Sourced: an audio server for the tests of the sound driver. Where it can be installed, it is, and tests that miss it fail.
has_sound() { command -v jackd > /dev/null && ldconfig -p 2> /dev/null | grep -q libportaudio.so.2; }
if ! has_sound && command -v apt-get > /dev/null; then
    as_root=""
    [ "$(id -u)" = 0 ] || as_root="sudo -n"
    echo "+ apt-get install jackd2 libportaudio2"
    { $as_root apt-get update -q && $as_root env DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends jackd2 libportaudio2; } > /dev/null 2>&1 || true
fi
if has_sound; then
    export VIBROLOCK_SOUND=required
else
    echo "no jackd with PortAudio, and none can be installed here: tests of the sound card over JACK say that they skip"
fi
