/* controller_records.h: the records by which the controller of the tests tells what it saw. */
#ifndef AEOLID_TESTS_CONTROLLER_RECORDS_H
#define AEOLID_TESTS_CONTROLLER_RECORDS_H

enum { ODD = 150, CALLS = 155, TOLD = 160, RECORDS = 168 };

#endif
/* SPDX-License-Identifier: MIT */
