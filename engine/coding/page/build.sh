#!/bin/sh
# Compiles what runs in a page, decoder or picks: build.sh NAME OUT.wasm.gz [RUSTC]. With the compiler of Debian 12 the bytes are those that are committed:
# apt-get install --no-install-recommends rustc libstd-rust-dev-wasm32 lld
set -eu
name=$1
case $2 in /*) out=$2 ;; *) out=$PWD/$2 ;; esac
rustc=${3:-/usr/bin/rustc}
here=$(cd "$(dirname "$0")" && pwd)
made=$(mktemp -d)
trap 'rm -rf "$made"' EXIT
flags="--edition 2021 --target wasm32-unknown-unknown -C opt-level=2 -C panic=abort -C codegen-units=1 -C embed-bitcode=yes"
cd "$here/.."
"$rustc" $flags --crate-type rlib --crate-name brickfield_coding --remap-path-prefix "$here/.."=. -o "$made/libbrickfield_coding.rlib" src/lib.rs
"$rustc" $flags -C lto=fat -C strip=symbols --crate-type cdylib --crate-name "$name" --remap-path-prefix "$here/.."=. --extern "brickfield_coding=$made/libbrickfield_coding.rlib" -o "$made/$name.wasm" "page/$name.rs"
gzip -9n "$made/$name.wasm"
chmod 644 "$made/$name.wasm.gz"
mv "$made/$name.wasm.gz" "$out"
