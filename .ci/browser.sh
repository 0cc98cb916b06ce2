# Sourced: a browser for the tests of the page. Where it can be installed, it is, and tests that miss it fail instead of skipping.
has_browser() { command -v chromium > /dev/null && command -v chromedriver > /dev/null; }
if ! has_browser && command -v apt-get > /dev/null; then
    as_root=""
    [ "$(id -u)" = 0 ] || as_root="sudo -n"
    echo "+ apt-get install chromium chromium-driver"
    { $as_root apt-get update -q && $as_root apt-get install -q -y --no-install-recommends chromium chromium-driver; } > /dev/null 2>&1 || true
fi
if has_browser; then
    export VIBROLOCK_BROWSER=required
else
    echo "no chromium with chromedriver, and none can be installed here: tests of the page in a browser say that they skip"
fi
