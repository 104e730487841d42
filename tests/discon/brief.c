/* A controller that touches the first 64 records only, for arrays that are no longer. */
void DISCON(float *swap, int *fail, const char *infile, char *outname, char *message);
void DISCON(float *swap, int *fail, const char *infile, char *outname, char *message)
{
    (void)infile;
    (void)outname;
    (void)message;
    *fail = 0;
    swap[45 - 1] = swap[42 - 1] = swap[43 - 1] = swap[44 - 1] = 0.1F;
    swap[47 - 1] = 4e4F;
}
/* SPDX-License-Identifier: MIT */
