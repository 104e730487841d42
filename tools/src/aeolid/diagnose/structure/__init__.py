"""What equations say: degrees of freedom, relative motions, flows, unmeasured forces, modal form."""
