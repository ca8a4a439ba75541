#!/usr/bin/env bash
# Tests the viewer's page in Chromium through forwarded ports and nginx. Needs what run.sh needs,
# and Debian's nginx-light and openssl. Usage: proxies.sh STYMO_VIEW. Exits with 77 (skipped) where
# something is missing.
set -euo pipefail
viewer=${1:?usage: proxies.sh STYMO_VIEW}
here=$(cd "$(dirname "$0")" && pwd)
source "$here/prerequisites.sh"
nginx=$(PATH=$PATH:/usr/sbin command -v nginx) ||
    skip "nginx is not installed (apt-get install nginx-light)"
command -v openssl >/dev/null || skip "openssl is not installed (apt-get install openssl)"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
openssl req -x509 -newkey rsa:2048 -nodes -days 1 -subj /CN=name.test \
    -keyout "$work/key.pem" -out "$work/certificate.pem" 2>/dev/null
node "$here/proxies.mjs" "$viewer" "$nginx" "$modules" "$chromium" "$work"
