#!/usr/bin/env bash
# Shows a page as a desktop and as a phone see it, light and dark: four PNG files.
# usage: scripts/screenshots.sh PAGE OUT [HEIGHT]
#   PAGE    an HTML file, such as RUN/report.html
#   OUT     folder to write desktop_light.png, desktop_dark.png, phone_light.png and phone_dark.png to
#   HEIGHT  of the pictures, in pixels [default: 4000]
# environment: CHROME  the browser [default: chromium, chromium-browser, google-chrome or chrome on the path]
set -euo pipefail

if [ $# -lt 2 ] || [ ! -f "$1" ]; then
    sed -n '3,7s/^# //p' "$0" >&2
    exit 2
fi
page=$(cd "$(dirname "$1")" && pwd)/$(basename "$1")
mkdir -p "$2"
out=$(cd "$2" && pwd)
height=${3:-4000}
chrome=${CHROME:-}
for name in chromium chromium-browser google-chrome chrome; do
    [ -n "$chrome" ] || chrome=$(command -v "$name" || true)
done
[ -n "$chrome" ] || { echo "error: no browser was found; install chromium, or set CHROME to its path" >&2 && exit 1; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# A browser's window is never as narrow as a phone, but a frame is.
for device in desktop:1280 phone:390; do
    width=${device#*:}
    cat >"$work/frame.html" <<END
<body style="margin: 0"><iframe src="file://$page" style="border: 0; width: ${width}px; height: ${height}px"></iframe>
END
    for scheme in 1:light 0:dark; do
        file=$out/${device%:*}_${scheme#*:}.png
        "$chrome" --headless --no-sandbox --disable-gpu --hide-scrollbars --user-data-dir="$work/profile" \
            --host-resolver-rules="MAP * ~NOTFOUND" --blink-settings="preferredColorScheme=${scheme%:*}" \
            --window-size="$((width < 500 ? 500 : width)),$height" --screenshot="$file" "file://$work/frame.html" \
            2>/dev/null
        [ -s "$file" ] || { echo "error: $chrome wrote no picture" >&2 && exit 1; }
        printf '%s\n' "$file"
    done
done
