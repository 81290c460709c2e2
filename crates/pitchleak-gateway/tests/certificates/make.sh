#!/bin/sh
# Makes what the tests' broker shows and asks for; nothing of it protects anything.
set -eu
cd "$(dirname "$0")"
ec="-newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes"
for name in authority another-authority; do
    openssl req -x509 $ec -days 36500 -subj "/CN=$name" -keyout $name.key -out $name.pem
done
printf 'subjectAltName=DNS:localhost,IP:127.0.0.1\n' >names.ext
for name in broker gateway; do
    openssl req $ec -subj /CN=$name -keyout $name.key -out $name.csr
    openssl x509 -req -in $name.csr -CA authority.pem -CAkey authority.key -CAcreateserial -days 36500 -extfile names.ext -out $name.pem
done
mosquitto_passwd -c -b passwords tester correct
rm -f ./*.srl ./*.csr ./*.ext authority.key another-authority.key
chmod 644 broker.key gateway.key passwords
